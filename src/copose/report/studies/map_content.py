"""What the map of a study shows: its places and what has become of each, axes, names and units."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from copose.poses import Array, Indices
from copose.report.studies.key_axes import KeyAxis, named_axes, titled, value_words
from copose.report.words import percent, three
from copose.studies.table import Status, StudyTable

Codes: TypeAlias = NDArray[np.int16]
"""What has become of places, as numbers."""


@dataclass(frozen=True)
class Ending:
    """An outcome of a place in a study."""

    status: Status  # of its best line
    arms: tuple[str, ...] = ()  # that miss their grasp

    @property
    def rank(self) -> int:
        """Its place among the endings of several seeds: the least one counts."""
        order = "solved", "infeasible", "failed", "missing"
        return 2 * order.index(self.status) + (self.status == "failed" and not self.arms)

    def words(self, arms: int) -> str:
        """An entry of a legend, of a problem with so many arms."""
        if self.status == "missing":
            return "not done yet"
        if not self.arms:
            return {"infeasible": "other constraints not met"}.get(self.status, self.status)
        if len(self.arms) == 2 == arms:
            names, can, does = "neither arm", "can reach", "reaches"
        else:
            names, can = " and ".join(self.arms), "cannot reach"
            does = "does not reach" if len(self.arms) == 1 else "do not reach"
        if self.status == "infeasible":
            return f"{names} {can}"
        return f"{names} {does}, as far as was searched"


@dataclass(frozen=True, eq=False)
class StudyPlaces:
    """The places of a study; a column has an entry for each.

    Of several seeds, and of all values of keys that the map leaves out, the one with the best
    objective is kept.
    """

    table: StudyTable  # of the study
    name: str  # of the number that is shown
    points: Indices  # of the seed that is kept
    codes: Codes  # what has become of a place, as numbers of ``endings``
    endings: tuple[Ending, ...]  # all that occur, solved ones first
    # Largest less smallest objective over the seeds, nan where not two are solved; empty of one
    # seed.
    spreads: Array

    @classmethod
    def of(cls, table: StudyTable, name: str = "objective", alone: int | None = None) -> Self:
        """The places of a table, of which a number is shown; along one axis alone, if one is named,
        of a grid.
        """
        study_points = table.study.points
        codes, endings = _coded(table)
        seeds = len(study_points.seeds)
        groups = np.arange(len(codes)).reshape(-1, seeds)
        if alone is not None:
            numbers = groups.reshape(*study_points.shape, seeds)
            groups = np.moveaxis(numbers, alone, 0).reshape(study_points.shape[alone], -1)
        if groups.shape[1] == 1:
            return cls(table, name, groups[:, 0], codes, endings, np.zeros(0))
        objective = np.where(codes == 0, table.numbers["objective"], np.nan)[groups]
        objective = np.where(np.isfinite(objective), objective, -np.inf)
        # Where nothing has an objective, the least code counts.
        least = codes[groups].argmin(axis=1)
        solved = np.isfinite(objective).any(axis=1)
        kept = np.where(solved, objective.argmax(axis=1), least)
        points = groups[np.arange(len(groups)), kept]
        spreads = _spreads(objective) if alone is None else np.full(len(groups), np.nan)
        return cls(table, name, points, codes[points], endings, spreads)

    def showing(self, name: str) -> StudyPlaces:
        """The same places with another number."""
        return replace(self, name=name)

    def __len__(self) -> int:
        return len(self.points)

    @cached_property
    def solved(self) -> NDArray[np.bool_]:
        """True where there is a number to show."""
        known: NDArray[np.bool_] = np.isfinite(self.table.numbers[self.name][self.points])
        known[self.codes != 0] = False
        return known

    @cached_property
    def done(self) -> NDArray[np.bool_]:
        """True where there is a line."""
        done: NDArray[np.bool_] = np.array([each.status != "missing" for each in self.endings])
        return done[self.codes]

    @cached_property
    def values(self) -> Array:
        """The number that is shown, nan where there is none."""
        return np.where(self.solved, self.table.numbers[self.name][self.points], np.nan)

    @property
    def best(self) -> int | None:
        """The place with the largest number; None where there is none."""
        return int(np.nanargmax(self.values)) if self.solved.any() else None

    def along(self, axis: int) -> Array:
        """Where the places are along an axis: a number, or the number of a row of other values."""
        points = self.table.study.points
        along = points.along(axis)[self.points // len(points.seeds)]
        numbers = points.axes[axis].numbers
        return along if numbers is None else numbers[along.astype(np.intp)]

    def counted(self) -> dict[Ending, int]:
        """How many places have come to each ending; none of 0."""
        counts = np.bincount(self.codes, minlength=len(self.endings)).tolist()
        return {
            ending: count for ending, count in zip(self.endings, counts, strict=True) if count > 0
        }


def _coded(table: StudyTable) -> tuple[Codes, tuple[Ending, ...]]:
    """The ending of each point as a number, and the endings by number, 0 a solved one."""
    pairs = {*zip(table.statuses, table.missing, strict=True)}
    endings = {
        (status, arms): Ending(
            status, tuple(arms.split(",")) if arms and status != "solved" else ()
        )
        for status, arms in pairs
    }
    different = sorted(
        {*endings.values(), Ending("solved")}, key=lambda ending: (ending.rank, ending.arms)
    )
    numbers = {pair: different.index(ending) for pair, ending in endings.items()}
    coded = map(numbers.__getitem__, zip(table.statuses, table.missing, strict=True))
    return np.fromiter(coded, dtype=np.int16, count=len(table)), tuple(different)


def _spreads(objective: Array) -> Array:
    known = np.isfinite(objective)
    largest = np.where(known, objective, -np.inf).max(axis=1)
    smallest = np.where(known, objective, np.inf).min(axis=1)
    return np.where(known.sum(axis=1) > 1, largest - smallest, np.nan)


def pareto_front(one: Array, other: Array) -> Indices:
    """The points that no other point beats: none is at least as large in both numbers and larger
    in one. Of equal points the first counts; one without a number, nan, does not.

    Returns:
        Their numbers, by ``one`` descending, so that ``other`` ascends.
    """
    known = np.flatnonzero(np.isfinite(one) & np.isfinite(other))
    order = known[np.lexsort((-other[known], -one[known]))]
    highest = np.maximum.accumulate(other[order])
    front = np.ones(len(order), dtype=bool)
    front[1:] = other[order][1:] > highest[:-1]
    return order[front]


@dataclass(frozen=True, eq=False)
class MapContent:
    """The content of a map."""

    places: StudyPlaces  # with the number that is shown
    axes: tuple[KeyAxis, ...]  # the horizontal one, the vertical one, further ones
    value: str  # name of the number
    unit: str  # of the number, empty where it has none
    arms: tuple[str, ...]  # names, in the order of the problem

    @classmethod
    def of(cls, table: StudyTable) -> Self:
        """The map of a table as its study file asks for it."""
        study, shown = table.study, table.study.file.map
        axes = list(named_axes(study.points))
        for key in (shown.y, shown.x):
            asked = [axis for axis in axes if key in study.points.axes[axis.number].keys]
            axes = [*asked, *(axis for axis in axes if axis not in asked)]
        alone = None
        if shown.x is not None and shown.y is None and not study.points.sampled:
            alone, axes = axes[0].number, axes[:1]
        problem = study.problems.at(study.points.values(0))
        value, unit = value_words(study, shown.value)
        arms = tuple(arm.name for arm in problem.arms)
        places = StudyPlaces.of(table, shown.value, alone)
        return cls(places, tuple(axes), value, unit, arms)

    @property
    def table(self) -> StudyTable:
        """The table."""
        return self.places.table

    @property
    def title(self) -> str:
        """The number's name and unit."""
        return titled(self.value, self.unit)

    @property
    def sampled(self) -> bool:
        """Whether the points are a sample and no grid."""
        return self.table.study.points.sampled

    @property
    def best(self) -> int | None:
        """The place with the largest number; None where there is none, or where kinds differ."""
        ranked = self.places.name != "objective" or self.table.study.file.comparable
        return self.places.best if ranked else None

    @property
    def best_word(self) -> str:
        """What the place with the largest number is called."""
        return "best" if self.places.name == "objective" else "largest"

    def grid(self, column: Any) -> Any:
        """A column of the places as a grid along the axes of the map."""
        order = [axis.number for axis in self.axes]
        return column.reshape(self.table.study.points.shape).transpose(order)

    def where(self, place: int) -> list[float]:
        """Where a place is along each axis."""
        return [float(self.along(axis)[place]) for axis in self.axes]

    def along(self, axis: KeyAxis) -> Array:
        """Where the places are along an axis."""
        return self.places.along(axis.number)

    def told(self, place: int) -> str:
        """The values of a place in words."""
        pairs = zip(self.axes, self.where(place), strict=True)
        return ", ".join(axis.told(along) for axis, along in pairs)

    @cached_property
    def trade_off(self) -> TradeOff | None:
        """The two numbers of the Pareto front; None where none is asked for."""
        names = self.table.study.file.map.pareto
        return None if names is None else TradeOff.of(self.places, names)

    def heading(self) -> str:
        """The name of the study and its message: the best place."""
        name, place = self.table.study.file.name, self.best
        if place is None:
            none = "" if self.places.solved.any() else ": no point is solved"
            return f"{name}{none}"
        number = f"{three(float(self.places.values[place]))} {self.unit}".rstrip()
        return f"{name}: {self.best_word} {self.value} {number} at {self.told(place)}"

    def counts(self) -> str:
        """How many places have come to what, in words."""
        counts = Counter[str]()
        for ending, count in self.places.counted().items():
            counts["not done yet" if ending.status == "missing" else ending.status] += count
        total = len(self.places)
        points = f"{total:,} {'point' if total == 1 else 'points'}"
        return f"{points}: {', '.join(f'{n:,} {word}' for word, n in counts.items())}"

    def seeds_told(self, agree: float = 1e-6) -> str:
        """What several seeds have to say: the spread of the objective; empty of one seed."""
        seeds = len(self.table.study.points.seeds)
        if seeds == 1:
            return ""
        spreads = self.places.spreads[np.isfinite(self.places.spreads)]
        if not spreads.size:
            return f"the best of {seeds} seeds"
        if spreads.max() <= agree:
            return f"the best of {seeds} seeds, which all agree"
        share = percent(float((spreads <= agree).mean())).removesuffix(".0")
        median, largest = three(float(np.median(spreads))), three(float(spreads.max()))
        return (
            f"the best of {seeds} seeds, which agree at {share} % of the points; spread "
            f"(largest − smallest): median {median}, at most {largest}"
        )


@dataclass(frozen=True, eq=False)
class TradeOff:
    """Two numbers of each place of which as much as possible is wanted, or as little."""

    names: tuple[str, str]  # of the numbers
    signs: tuple[int, int]  # 1 where much is wanted, −1 where little is
    numbers: Array  # of the places, (2, places)
    front: Indices  # places that no other one beats, from much of the first number to little

    @classmethod
    def of(cls, places: StudyPlaces, asked: tuple[str, str]) -> Self:
        """The trade-off between two numbers, ``-`` in front of what is to be small."""
        one, other = (name.removeprefix("-") for name in asked)
        signs = tuple(-1 if name.startswith("-") else 1 for name in asked)
        numbers = np.array([places.showing(name).values for name in (one, other)])
        front = pareto_front(signs[0] * numbers[0], signs[1] * numbers[1])
        return cls((one, other), (signs[0], signs[1]), numbers, front)
