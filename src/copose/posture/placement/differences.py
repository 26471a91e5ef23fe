"""Differences of placements: which are one, which are alike, and which are known already."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from copose.cell.cell import Cell
from copose.poses import Array, Mask
from copose.posture.placement.placed import Placed
from copose.selection import far_apart_rows


@dataclass(frozen=True, eq=False)
class Differences:
    """A measure of how far placements are apart: the largest difference of any coordinate.

    Attributes:
        cell: the arms.
        span: the ranges of what is free, (d,).
    """

    cell: Cell
    span: Array

    def _arrays(self, placed: Sequence[Placed]) -> tuple[Array, Array]:
        """Joints, (count, C, N), and free coordinates over ranges, (count, C, d)."""
        return np.array([one.q for one in placed]), np.array([one.x for one in placed]) / self.span

    def _apart(self, many: tuple[Array, Array], q: Array, x: Array) -> Array:
        """Differences to one of many, of joints, rad or m, and of shares of ranges, (count,)."""
        joints = [self.cell.distances(many[0][:, k], q_k) for k, q_k in enumerate(q)]
        moved = np.abs(many[1] - x).max(axis=(1, 2), initial=0.0)
        return np.asarray(np.maximum(np.max(joints, axis=0), moved))

    def unknown(
        self, starts: Sequence[Placed], known: Sequence[Placed], least: float
    ) -> list[Placed]:
        """The starts that differ by more than the least from all that are known."""
        if not starts or not known:
            return list(starts)
        others = self._arrays(known)
        each = zip(starts, *self._arrays(starts), strict=True)
        return [start for start, q, x in each if self._apart(others, q, x).min() > least]

    def distinct(
        self, starts: Sequence[Placed], least: float, most: int, of_each: int
    ) -> list[Placed]:
        """The first starts that differ by more than the least, so many of each placement at most.

        Starts of one placement tend to end alike.
        """
        if not starts:
            return []
        q, x = self._arrays(starts)
        places = np.unique(x.reshape(len(x), -1), axis=0, return_inverse=True)[1].ravel()
        taken = np.zeros(len(starts), dtype=np.intp)

        def near(row: int, _: Mask) -> Mask:
            taken[places[row]] += 1
            full = places == places[row] if taken[places[row]] >= of_each else False
            return np.asarray((self._apart((q, x), q[row], x[row]) <= least) | full)

        free = np.ones(len(starts), dtype=bool)
        return [starts[row] for row in far_apart_rows(free, near, most)]

    def of_places(self, ends: Sequence[Placed], least: float, most: int) -> list[Placed]:
        """The first ends whose placements differ by more than the least, as a share of ranges."""
        if not ends:
            return []
        x = self._arrays(ends)[1]

        def near(row: int, _: Mask) -> Mask:
            return np.asarray(np.abs(x - x[row]).max(axis=(1, 2), initial=0.0) <= least)

        free = np.ones(len(ends), dtype=bool)
        return [ends[row] for row in far_apart_rows(free, near, most)]

    def gathered(self, ends: Sequence[Placed], least: float, same: float) -> list[Placed]:
        """Distinct ends, best first, with how many ended in each.

        Args:
            ends: of climbs.
            least: difference of coordinates of what is not the same.
            same: alike, of values.
        """
        if not ends:
            return []
        ends = sorted(ends, key=lambda end: -end.value)
        q, x = self._arrays(ends)
        values = np.array([end.value for end in ends])
        optima, rows = list[Placed](), list[int]()
        for row, end in enumerate(ends):
            first = int(np.searchsorted(-values[rows], -end.value - same))
            alike = rows[first:]
            near = self._apart((q[alike], x[alike]), q[row], x[row]) < least
            if near.any():
                known = first + int(near.argmax())
                optima[known] = replace(optima[known], count=optima[known].count + end.count)
            else:
                optima.append(end)
                rows.append(row)
        return optima
