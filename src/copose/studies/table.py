"""The table of a study: its points in order, with what their lines say."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal, Self

import numpy as np

from copose.poses import Array, Indices
from copose.studies.record import RecordLines
from copose.studies.study import Study, StudyFolder

Status = Literal["solved", "infeasible", "failed", "missing"]


@dataclass(frozen=True, eq=False)
class StudyTable:
    """The points of a study in order, with what their lines say; a column has an entry a point."""

    study: Study  # whose points they are
    statuses: tuple[Status, ...]  # of the results; ``missing`` of a point without a line
    numbers: dict[str, Array]  # ``objective`` and what is recorded, nan where there is none
    # Arms that miss their grasp, by name with commas, empty where none does.
    missing: tuple[str, ...]
    seconds: Array  # that each point took, nan of points without a line
    arms: tuple[str, ...]  # whose joints are recorded, of cases ``case.arm``
    offsets: Indices  # of the lines in the record
    lines: RecordLines | None  # of the record; None where it is empty

    @classmethod
    def of(cls, study: Study, folder: StudyFolder) -> Self:
        """The table of what is recorded in a folder.

        Raises:
            InputError: the record cannot be read.
        """
        offsets = study.index.offsets(folder.record)
        lines = RecordLines(folder.record) if (offsets >= 0).any() else None
        statuses, missing = list[Status](), list[str]()
        names = ("objective", *study.file.record)
        numbers = {name: np.full(len(offsets), np.nan) for name in names}
        seconds, arms = np.full(len(offsets), np.nan), dict[str, None]()
        for point, line in enumerate(_read(lines, offsets)):
            statuses.append("missing" if line is None else line["status"])
            missing.append("" if line is None else ",".join(line["missing"]))
            if line is None:
                continue
            seconds[point] = line["seconds"]
            numbers["objective"][point] = _number(line["objective"])
            for name in study.file.record:
                numbers[name][point] = _number(line["record"].get(name))
            arms |= dict.fromkeys(name for name, _ in by_arm(line["joints"] or {}))
        return cls(
            study, tuple(statuses), numbers, tuple(missing), seconds, tuple(arms), offsets, lines
        )

    def __len__(self) -> int:
        return len(self.statuses)

    def values(self, point: int) -> dict[str, Any]:
        """The value of every key that varies at a point."""
        return self.study.points.values(point)

    def column(self, key: str) -> list[Any]:
        """The values of a key at all points."""
        return [self.values(point)[key] for point in range(len(self))]

    def line(self, point: int) -> dict[str, Any] | None:
        """The line of a point; None where there is none."""
        offset = int(self.offsets[point])
        return None if offset < 0 or self.lines is None else self.lines.at(offset)

    def best(self, count: int, name: str = "objective") -> list[int]:
        """The solved points with the largest numbers, the best first; of equals the first first.

        Of several seeds the one with the best objective counts. There is no best where the
        objective is of several kinds.
        """
        seeds = len(self.study.points.seeds)
        if name == "objective" and not self.study.file.comparable:
            return []
        solved = np.array([status == "solved" for status in self.statuses])
        objective = np.where(solved, self.numbers["objective"], -np.inf)
        objective = np.where(np.isfinite(objective), objective, -np.inf).reshape(-1, seeds)
        points = np.arange(len(objective)) * seeds + objective.argmax(axis=1)
        values = np.where(solved[points], self.numbers[name][points], np.nan)
        order = np.argsort(-values, kind="stable")[:count]
        return [int(points[place]) for place in order if math.isfinite(values[place])]


def _read(lines: RecordLines | None, offsets: Indices) -> Iterator[dict[str, Any] | None]:
    for offset in offsets.tolist():
        yield None if offset < 0 or lines is None else lines.at(offset)


def by_arm(joints: dict[str, Any]) -> Iterator[tuple[str, list[float]]]:
    """The joints of a line by arm, of cases by ``case.arm``."""
    for name, q in joints.items():
        if isinstance(q, dict):
            yield from ((f"{name}.{arm}", each) for arm, each in q.items())
        else:
            yield name, q


def _number(value: Any) -> float:
    return float(value) if isinstance(value, (int, float)) else math.nan
