"""What the map of a study shows: its places, axes in the order of the picture, names and units."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np

from copose.poses import Array, Indices
from copose.report.studies.key_axes import KeyAxis, named_axes, titled, value_words
from copose.report.studies.places import StudyPlaces
from copose.report.words import percent, three
from copose.studies.table import StudyTable


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
