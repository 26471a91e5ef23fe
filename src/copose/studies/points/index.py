"""The points of a study by their hashes: which lines of a record are theirs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from copose.poses import Indices
from copose.studies.points.hashes import PointHashes
from copose.studies.points.points import Points
from copose.studies.record import lines_of


class PointIndex:
    """The points of a study in the order of their hashes, of which 8 bytes are kept: a million
    points need 24 MB, and 65 MB while it is built.

    Attributes:
        twins: the first point with the hash of each: points with equal values are one.
    """

    def __init__(self, points: Points, hashes: PointHashes) -> None:
        """The index of some points."""
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
        """Where in a record the last line of each point begins, −1 of points without one, (count,).

        Args:
            record: its file; where there is none no point has a line.
            block: number of lines that are looked up at once.

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
