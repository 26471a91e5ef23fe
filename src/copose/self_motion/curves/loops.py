"""Self-motions with one degree of freedom, followed from many postures at once."""

from __future__ import annotations

import numpy as np

from copose.cell.cell import Cell
from copose.poses import Array, Indices, Mask
from copose.self_motion.kernels import ArmKernels
from copose.self_motion.projection import project

# Between points within limits and beyond them, rad (or m): the norm of the joints' differences.
_SPACING, _WIDEST = 0.2, 0.5
_LONGEST = 400
_SHORTEST = 1 / 32
_SAME, _BESIDE = 1e-4, 0.05
_CLOSED = 1e-6


class Loops:
    """The self-motions of an arm without regard to its joint limits, by points along them.

    Postures on one loop are many at a time: each is followed both ways until it meets another, so
    that a loop is closed in a few steps.

    Attributes:
        points: along all loops, (count, n); with no degree of freedom to spare the postures.
        spacing: of points that are near the limits or within them.
    """

    spacing = _SPACING

    def __init__(self, cell: Cell, kernels: ArmKernels, i: int, goal: Array) -> None:
        """No loops yet of arm i of a cell."""
        self._cell, self._kernels, self._i, self._goal = cell, kernels, i, goal
        self._spare = kernels.n > kernels.m
        self._free = np.full(kernels.n, np.inf)
        self.points = self._tangents = np.zeros((0, kernels.n))
        self._paces = np.zeros(0)
        self._loops = self._met = np.zeros(0, dtype=np.intp)

    @property
    def count(self) -> int:
        """How many loops there are."""
        return len(np.unique(self._loops))

    def innermost(self, beyond: float) -> Array:
        """Of each loop the point that is deepest within limits, (count, n); none of a loop that is
        farther beyond them than that everywhere, rad (or m).
        """
        depth = self._cell.beyond(self._i, self.points) if len(self.points) else np.zeros(0)
        order = np.lexsort([depth, self._loops])
        first = np.unique(self._loops[order], return_index=True)[1]
        rows = order[first]
        return np.asarray(self.points[rows[depth[rows] <= beyond]])

    def closed(self, q: Array) -> Array:
        """Postures, (count, n), projected onto self-motions; those that cannot be are left out."""
        ends, gaps = self._project(q, 25, _CLOSED)
        return np.asarray(ends[(gaps < _CLOSED) & np.isfinite(ends).all(axis=1)])

    def add(self, q: Array) -> bool:
        """Follow closed postures, (count, n), that are on no known loop.

        Returns:
            Whether there may be more: while no loop has been met just once, random postures hardly
            miss one (I. J. Good, 1953).
        """
        new = q[self._beside(q) < 0]
        if len(new) and self._spare:
            self._follow(self._spread(new))
        elif len(new):
            self._keep_apart(new)
        beside = self._beside(q)
        self._met = np.concatenate([self._met, beside[beside >= 0]])
        met = np.unique(self._loops[self._met], return_counts=True)[1]
        return len(met) == 0 or bool(met.min() == 1)

    def _spread(self, q: Array) -> Array:
        """Those of the postures that keep a distance: the others add nothing to a loop."""
        places = self._cell.embedded(self._i, q)
        square = (places**2).sum(axis=1)
        near = square[:, None] + square - 2 * places @ places.T <= (0.8 * _SPACING) ** 2
        free, chosen = np.ones(len(q), dtype=bool), []
        for row, beside in enumerate(near):
            if free[row]:
                chosen.append(row)
                free &= ~beside
        return np.asarray(q[chosen])

    def _project(self, q: Array, steps: int, closed: float) -> tuple[Array, Array]:
        return project(
            self._kernels, q, self._goal, -self._free, self._free, steps=steps, closed=closed
        )

    def _keep_apart(self, q: Array) -> None:
        """Isolated postures, each once."""
        places = self._cell.embedded(self._i, q)
        for row, place in zip(q, places, strict=True):
            known = self._cell.embedded(self._i, self.points)
            if np.all(np.linalg.norm(known - place, axis=1) > _SAME):
                here = row[None]
                self._remember(here, 0 * here, np.full(1, _SAME), np.array([len(self.points)]))

    def _remember(self, points: Array, tangents: Array, paces: Array, loops: Indices) -> None:
        self.points = np.vstack([self.points, points])
        self._tangents = np.vstack([self._tangents, tangents])
        self._paces = np.concatenate([self._paces, paces])
        self._loops = np.concatenate([self._loops, loops])

    def _beside(self, q: Array) -> Indices:
        """The point of a loop that each posture lies beside, as if on the loop, or −1."""
        if len(self.points) == 0 or len(q) == 0:
            return np.full(len(q), -1)
        places, known = (self._cell.embedded(self._i, x) for x in (q, self.points))
        nearest = (2 * places @ known.T - (known**2).sum(axis=1)).argmax(axis=1)
        offset = self._cell.nearest_turn(self._i, q - self.points[nearest])
        along = (offset * self._tangents[nearest]).sum(axis=1)
        aside = np.linalg.norm(offset - along[:, None] * self._tangents[nearest], axis=1)
        # Tangents are chords, and loops bend.
        near = np.abs(along) < self._paces[nearest] + _SAME
        near &= aside < _BESIDE * self._paces[nearest] + 0.4 * np.abs(along)
        return np.where(near, nearest, -1)

    def _follow(self, seeds: Array) -> None:
        """Points along the self-motions through closed postures, both ways until they meet."""
        _, J = self._kernels.residual(seeds, self._goal)
        tangents = np.linalg.qr(J.swapaxes(1, 2), mode="complete")[0][:, :, -1]
        count, n = seeds.shape
        front = np.repeat(seeds, 2, axis=0)
        heading = np.stack([tangents, -tangents], axis=1).reshape(-1, n)
        places = self._cell.embedded(self._i, front)
        pace, shrink = self._pace(front), np.ones(2 * count)
        loops = np.repeat(np.arange(count) + len(self.points), 2)
        found = [(seeds, tangents, pace[::2], np.arange(0, 2 * count, 2))]
        going = np.ones(2 * count, dtype=bool)
        for step in range(_LONGEST):
            found.append(self._meet(front, places, heading, pace * shrink, going, loops))
            if step > 0:
                beside = self._beside(front[going])
                for row, point in zip(np.flatnonzero(going), beside, strict=True):
                    if point >= 0:
                        going[row] = False
                        loops[loops == loops[row]] = self._loops[point]
            rows = np.flatnonzero(going)
            if len(rows) == 0:
                break
            far = pace[rows] * shrink[rows]
            ends, gaps = self._project(front[rows] + far[:, None] * heading[rows], 3, _CLOSED)
            moved = ends - front[rows]
            length = np.sqrt((moved**2).sum(axis=1))
            straight = (moved * heading[rows]).sum(axis=1) > 0.8 * length
            good = (gaps < 1e-4) & straight & (length < 1.5 * far) & (length > 0.3 * far)
            shrink[rows] = np.where(good, np.minimum(2 * shrink[rows], 1.0), shrink[rows] / 2)
            going[rows[shrink[rows] < _SHORTEST]] = False
            onward, moved = rows[good], moved[good]
            front[onward] = ends[good]
            places[onward] = self._cell.embedded(self._i, ends[good])
            heading[onward] = moved / length[good, None]
            pace[onward] = self._pace(front[onward])
            found.append((front[onward], heading[onward], far[good], onward))
            going[onward[self._left(front[onward])]] = False
        points, headings, paces, rows = (np.concatenate(p) for p in zip(*found, strict=True))
        self._remember(points, headings, paces, loops[rows])

    def _meet(
        self,
        front: Array,
        places: Array,
        heading: Array,
        pace: Array,
        going: Mask,
        loops: Indices,
    ) -> tuple[Array, Array, Array, Indices]:
        """Stop the fronts that are about to meet, and join their loops.

        Returns:
            Points half way between those fronts, the direction there, the distance to either front,
            and one of them.
        """
        rows = np.flatnonzero(going)
        square = (places**2).sum(axis=1)
        apart = square[rows, None] + square - 2 * places[rows] @ places.T
        candidates = apart < (1.1 * (pace[rows, None] + pace)) ** 2
        candidates &= heading[rows] @ heading.T < -0.7
        one, other = np.nonzero(candidates)
        one = rows[one]
        # Of two that are going each sees the other.
        once = (one < other) | ~going[other]
        one, other = one[once], other[once]
        gap = self._cell.nearest_turn(self._i, front[other] - front[one])
        distance = np.sqrt((gap**2).sum(axis=1))
        ahead = (gap * heading[one]).sum(axis=1) >= 0.9 * distance
        ahead &= (gap * heading[other]).sum(axis=1) <= -0.9 * distance
        # The two fronts of one posture set out back to back from the same place.
        ahead &= distance > _SAME
        one, other, gap, distance = one[ahead], other[ahead], gap[ahead], distance[ahead]
        for a, b in zip(one, other, strict=True):
            going[a] = going[b] = False
            loops[loops == loops[b]] = loops[a]
        wide = distance > 1.2 * _SPACING
        one, gap, distance = one[wide], gap[wide], distance[wide]
        return front[one] + gap / 2, gap / distance[:, None], distance / 2, one

    def _pace(self, q: Array) -> Array:
        """How far to go on: no joint reaches its limits on the way unless it is near them."""
        # np.clip takes longer than both.
        beyond = np.maximum(self._cell.beyond(self._i, q), _SPACING)
        return np.asarray(np.minimum(beyond, _WIDEST))

    def _left(self, q: Array) -> Mask:
        """Whether a sliding joint has left its limits: it does not come back by itself."""
        gone = np.zeros(len(q), dtype=bool)
        for j, joint in enumerate(self._cell.arms[self._i].joints):
            if joint.kind == "prismatic":
                lower, upper = self._cell.lower[self._i][j], self._cell.upper[self._i][j]
                gone |= (q[:, j] < lower - _SPACING) | (q[:, j] > upper + _SPACING)
        return gone
