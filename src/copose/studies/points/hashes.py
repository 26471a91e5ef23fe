"""Hashes of the points of a study, and the points by their hashes."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from copose.poses import Indices
from copose.studies.points.points import Points
from copose.studies.record import lines_of
from copose.studies.study_file import StudyFile
from copose.version import __version__

# Of the lines of a record; one more whenever their keys or their meaning change.
RECORD_FORMAT = 1
# JSON that is the same for equal data; dates and their like as TOML has them.
canonical = json.JSONEncoder(sort_keys=True, separators=(",", ":"), default=str).encode


@dataclass(frozen=True)
class RobotDigests:
    """Hashes of the robot files that points read."""

    whole: str  # of all files
    # For each ``[[vary]]`` whose values name different files its keys, and the number of the choice
    # by a row of their values, JSON.
    choices: tuple[tuple[tuple[str, ...], Mapping[str, int]], ...] = ()
    # Hash of the files of a combination of choices, by their numbers with commas.
    parts: Mapping[str, str] = field(default_factory=dict)

    def at(self, values: Mapping[str, Any]) -> str:
        """The hash of the files that a point with these values reads."""
        numbers = []
        for keys, rows in self.choices:
            numbers.append(rows.get(canonical([values[key] for key in keys])))
        return self.parts.get(",".join(map(str, numbers)), self.whole)

    @classmethod
    def of_text(cls, text: str) -> Self:
        """The digests of their `text`.

        Raises:
            ValueError: it is none.
        """
        whole, choices, parts = json.loads(text)
        return cls(whole, tuple((tuple(keys), rows) for keys, rows in choices), parts)

    @property
    def text(self) -> str:
        """All of it as JSON."""
        return canonical([self.whole, self.choices, self.parts])


class PointHashes:
    """The hashes of a study's points: of what all have in common, of each one's values and seed.

    Attributes:
        common: hash of problem, command, effort, what is recorded, and version.
        robots: hashes of robot files.
    """

    def __init__(self, common: str, robots: RobotDigests) -> None:
        """The hashes of points with this in common, see `of`."""
        self.common, self.robots = common, robots
        self._state = hashlib.blake2b(common.encode(), digest_size=16)

    @classmethod
    def of(cls, study: StudyFile, tables: Mapping[str, Any], robots: RobotDigests) -> Self:
        """The hashes of a study, of the tables of its problem, see `PointProblems`."""
        common = {
            "format": RECORD_FORMAT,
            "copose": __version__,
            "problem": {k: v for k, v in tables.items() if k not in ("description", "name")},
            "command": study.command,
            "effort": study.effort,
            "record": study.record,
        }
        digest = hashlib.blake2b(canonical(common).encode(), digest_size=16).hexdigest()
        return cls(digest, robots)

    def at(self, values: Mapping[str, Any], seed: int) -> bytes:
        """The hash of a point, 16 bytes."""
        state = self._state.copy()
        own = {"values": values, "seed": seed, "robots": self.robots.at(values)}
        state.update(canonical(own).encode())
        return state.digest()


class PointIndex:
    """The points of a study in the order of their hashes, of which 8 bytes are kept: a million
    points need 24 MB, and 65 MB while it is built.

    Attributes:
        twins: the first point with the hash of each: points with equal values are one.
    """

    def __init__(self, points: Points, hashes: PointHashes) -> None:
        count = len(points)
        numbers = np.fromiter(
            (_number(hashes.at(points.values(i), points.seed(i))) for i in range(count)),
            dtype=np.uint64,
            count=count,
        )
        self._numbers, first, inverse = np.unique(numbers, return_index=True, return_inverse=True)
        self._first: Indices = first
        self.twins: Indices = first[inverse]

    def __len__(self) -> int:
        """Number of different points."""
        return len(self._first)

    def offsets(self, record: Path, block: int = 100_000) -> Indices:
        """Offsets in a record at which the last line of each point begins, −1 of points without
        one, (count,); where there is no record none has one.

        Raises:
            InputError: it cannot be read.
        """
        offsets = np.full(len(self.twins), -1, dtype=np.intp)
        if not record.exists():
            return offsets
        numbers, begins = list[int](), list[int]()
        for point_hash, offset in lines_of(record):
            numbers.append(_number(point_hash))
            begins.append(offset)
            if len(numbers) == block:
                self._enter(offsets, numbers, begins)
                numbers, begins = [], []
        self._enter(offsets, numbers, begins)
        return offsets[self.twins]

    def _enter(self, offsets: Indices, numbers: list[int], begins: list[int]) -> None:
        looked: NDArray[np.uint64] = np.array(numbers, dtype=np.uint64)
        places = np.minimum(np.searchsorted(self._numbers, looked), len(self._numbers) - 1)
        known = self._numbers[places] == looked
        # Of several lines of a point the last one is assigned last.
        offsets[self._first[places[known]]] = np.array(begins, dtype=np.intp)[known]


def _number(point_hash: bytes) -> int:
    return int.from_bytes(point_hash[:8], "big")
