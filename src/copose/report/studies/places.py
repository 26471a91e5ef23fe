"""The places of a study, its points without their seeds, and what has become of each."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from copose.poses import Array, Indices
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
    endings = {pair: _ending(*pair) for pair in pairs}
    different = sorted(
        {*endings.values(), Ending("solved")}, key=lambda ending: (ending.rank, ending.arms)
    )
    numbers = {pair: different.index(ending) for pair, ending in endings.items()}
    coded = map(numbers.__getitem__, zip(table.statuses, table.missing, strict=True))
    return np.fromiter(coded, dtype=np.int16, count=len(table)), tuple(different)


def _ending(status: Status, missing: str) -> Ending:
    return Ending(status, tuple(missing.split(",")) if missing and status != "solved" else ())


def _spreads(objective: Array) -> Array:
    known = np.isfinite(objective)
    largest = np.where(known, objective, -np.inf).max(axis=1)
    smallest = np.where(known, objective, np.inf).min(axis=1)
    return np.where(known.sum(axis=1) > 1, largest - smallest, np.nan)
