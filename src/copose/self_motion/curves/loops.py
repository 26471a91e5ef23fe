"""Coverage of an arm's self-motions with one degree of freedom, limits aside, by coarse loops.

A coarse tracer of many postures at once. `curves.follow` traces one posture's self-motion exactly,
up to limits, by other steps: in planes across exact tangents, with tests that it stays on its
curve. Here a step is along the last chord and closed by `project`; it may end on a loop nearby,
which is found that way too. Their points differ, and all that is sampled with them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.cell.cell import Cell
from copose.poses import Array, Indices, Mask
from copose.selection import far_apart_rows
from copose.self_motion.kernels import ArmKernels
from copose.self_motion.manifold import null_vectors
from copose.self_motion.projection import project


@dataclass(frozen=True)
class LoopOptions:
    """Steps along loops; lengths are norms of differences of joints, rad (or m)."""

    spacing: float = 0.2  # of points within limits or near them
    widest: float = 0.5  # of points beyond
    steps: int = 400  # along a loop, each way
    shortest: float = 1 / 32  # of the spacing: a step that has to be shorter ends a loop
    closed: float = 1e-6  # residual that needs no further projection, m or rad
    on_loop: float = 1e-4  # residual of a point that counts, m or rad
    first_steps: int = 25  # of projection, for random postures
    next_steps: int = 3  # of projection, along a loop
    straight: float = 0.8  # least cosine between a step and the one before
    longer: float = 1.5  # of a step as projected, over its length, at most
    shorter: float = 0.3  # alike, at least
    same: float = 1e-4  # distance of postures that are the same
    aside: float = 0.05  # of a posture on a loop from its tangent, over the spacing there
    aside_along: float = 0.4  # the same over the distance along the tangent
    thinned: float = 0.8  # of the spacing: nearer postures start no loop of their own
    meeting: float = 1.1  # of both spacings: fronts that are nearer may meet
    opposed: float = -0.7  # cosine between the headings of fronts that meet, at most
    facing: float = 0.9  # cosine between a heading and the way to the other front, at least
    wide: float = 1.2  # of the spacing: a wider gap where fronts meet gets a point half way


class Loops:
    """Points along the self-motions of an arm without regard to its joint limits.

    Many postures are on one loop at a time: each is followed both ways until it meets another, so
    that a loop is closed in a few steps.

    Attributes:
        points: along all loops, (count, n); with no degree of freedom to spare the postures.
        options: of the steps.
    """

    def __init__(
        self,
        cell: Cell,
        kernels: ArmKernels,
        i: int,
        goal: Array,
        options: LoopOptions = LoopOptions(),
    ) -> None:
        """No loops yet of arm i of a cell."""
        self.options = options
        self._cell, self._kernels, self._i, self._goal = cell, kernels, i, goal
        self._spare = kernels.n > kernels.m
        self._free = np.full(kernels.n, np.inf)
        self.points = self._tangents = np.zeros((0, kernels.n))
        self._paces = np.zeros(0)
        self._loops = self._met = np.zeros(0, dtype=np.intp)

    @property
    def count(self) -> int:
        """Number of loops."""
        return len(np.unique(self._loops))

    def innermost(self, beyond: float) -> Array:
        """The point of each loop that is deepest within limits, (count, n).

        Args:
            beyond: distance beyond limits, rad (or m): a loop that is farther everywhere is left
                out.
        """
        depth = self._cell.beyond(self._i, self.points) if len(self.points) else np.zeros(0)
        order = np.lexsort([depth, self._loops])
        first = np.unique(self._loops[order], return_index=True)[1]
        rows = order[first]
        return np.asarray(self.points[rows[depth[rows] <= beyond]])

    def closed(self, q: Array) -> Array:
        """Postures, (count, n), projected onto self-motions; those that cannot be are left out."""
        ends, gaps = self._project(q, self.options.first_steps)
        return np.asarray(ends[(gaps < self.options.closed) & np.isfinite(ends).all(axis=1)])

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
        points = self._beside(q)
        self._met = np.concatenate([self._met, points[points >= 0]])
        met = np.unique(self._loops[self._met], return_counts=True)[1]
        return len(met) == 0 or bool(met.min() == 1)

    def _spread(self, q: Array) -> Array:
        """Postures that keep a distance from each other: others add nothing to a loop."""
        places = self._cell.embedded(self._i, q)
        square = (places**2).sum(axis=1)
        apart = self.options.thinned * self.options.spacing
        near = square[:, None] + square - 2 * places @ places.T <= apart**2
        free = np.ones(len(q), dtype=bool)
        return np.asarray(q[far_apart_rows(free, lambda row, _: near[row])])

    def _project(self, q: Array, steps: int) -> tuple[Array, Array]:
        """Postures projected without limits, (count, n), and their residuals, (count,)."""
        free, closed = self._free, self.options.closed
        return project(self._kernels, q, self._goal, -free, free, steps=steps, closed=closed)

    def _keep_apart(self, q: Array) -> None:
        """Add isolated postures, each once."""
        same = self.options.same
        places = self._cell.embedded(self._i, q)
        for row, place in zip(q, places, strict=True):
            known = self._cell.embedded(self._i, self.points)
            if np.all(np.linalg.norm(known - place, axis=1) > same):
                number, posture = np.array([len(self.points)]), row[None]
                self._remember(posture, 0 * posture, np.full(1, same), number)

    def _remember(self, points: Array, tangents: Array, paces: Array, loops: Indices) -> None:
        """Add points with their tangents, spacings and loops' numbers."""
        self.points = np.vstack([self.points, points])
        self._tangents = np.vstack([self._tangents, tangents])
        self._paces = np.concatenate([self._paces, paces])
        self._loops = np.concatenate([self._loops, loops])

    def _beside(self, q: Array) -> Indices:
        """The number of the point of a loop next to each posture on a loop, −1 of others."""
        if len(self.points) == 0 or len(q) == 0:
            return np.full(len(q), -1)
        places, known = (self._cell.embedded(self._i, x) for x in (q, self.points))
        nearest = (2 * places @ known.T - (known**2).sum(axis=1)).argmax(axis=1)
        offset = self._cell.nearest_turn(self._i, q - self.points[nearest])
        along = (offset * self._tangents[nearest]).sum(axis=1)
        aside = np.linalg.norm(offset - along[:, None] * self._tangents[nearest], axis=1)
        # Tangents are chords, and loops bend.
        options, paces = self.options, self._paces[nearest]
        near = np.abs(along) < paces + options.same
        near &= aside < options.aside * paces + options.aside_along * np.abs(along)
        return np.where(near, nearest, -1)

    def _follow(self, seeds: Array) -> None:
        """Add points along the self-motions through closed postures, both ways until they meet."""
        options = self.options
        _, J = self._kernels.residual(seeds, self._goal)
        tangents = null_vectors(J)
        count, n = seeds.shape
        front = np.repeat(seeds, 2, axis=0)
        heading = np.stack([tangents, -tangents], axis=1).reshape(-1, n)
        places = self._cell.embedded(self._i, front)
        pace, shrink = self._pace(front), np.ones(2 * count)
        loops = np.repeat(np.arange(count) + len(self.points), 2)
        parts = [(seeds, tangents, pace[::2], np.arange(0, 2 * count, 2))]
        going = np.ones(2 * count, dtype=bool)
        for step in range(options.steps):
            parts.append(self._meet(front, places, heading, pace * shrink, going, loops))
            if step > 0:
                on_loops = self._beside(front[going])
                for row, point in zip(np.flatnonzero(going), on_loops, strict=True):
                    if point >= 0:
                        going[row] = False
                        loops[loops == loops[row]] = self._loops[point]
            rows = np.flatnonzero(going)
            if len(rows) == 0:
                break
            far = pace[rows] * shrink[rows]
            ahead = front[rows] + far[:, None] * heading[rows]
            ends, gaps = self._project(ahead, options.next_steps)
            moved = ends - front[rows]
            length = np.sqrt((moved**2).sum(axis=1))
            good = (moved * heading[rows]).sum(axis=1) > options.straight * length
            good &= gaps < options.on_loop
            good &= (length < options.longer * far) & (length > options.shorter * far)
            shrink[rows] = np.where(good, np.minimum(2 * shrink[rows], 1.0), shrink[rows] / 2)
            going[rows[shrink[rows] < options.shortest]] = False
            onward, moved = rows[good], moved[good]
            front[onward] = ends[good]
            places[onward] = self._cell.embedded(self._i, ends[good])
            heading[onward] = moved / length[good, None]
            pace[onward] = self._pace(front[onward])
            parts.append((front[onward], heading[onward], far[good], onward))
            going[onward[self._left(front[onward])]] = False
        points, headings, paces, rows = (np.concatenate(p) for p in zip(*parts, strict=True))
        self._remember(points, headings, paces, loops[rows])

    def _meet(
        self, front: Array, places: Array, heading: Array, pace: Array, going: Mask, loops: Indices
    ) -> tuple[Array, Array, Array, Indices]:
        """Stop the fronts that are about to meet and join their loops.

        Returns:
            Points half way between those fronts, the directions there, the distances to either
            front, and the number of one of them.
        """
        options = self.options
        rows = np.flatnonzero(going)
        square = (places**2).sum(axis=1)
        apart = square[rows, None] + square - 2 * places[rows] @ places.T
        candidates = apart < (options.meeting * (pace[rows, None] + pace)) ** 2
        candidates &= heading[rows] @ heading.T < options.opposed
        one, other = np.nonzero(candidates)
        one = rows[one]
        # Of two that are going each sees the other.
        once = (one < other) | ~going[other]
        one, other = one[once], other[once]
        gap = self._cell.nearest_turn(self._i, front[other] - front[one])
        distance = np.sqrt((gap**2).sum(axis=1))
        ahead = (gap * heading[one]).sum(axis=1) >= options.facing * distance
        ahead &= (gap * heading[other]).sum(axis=1) <= -options.facing * distance
        # The two fronts of one posture set out back to back from the same place.
        ahead &= distance > options.same
        one, other, gap, distance = one[ahead], other[ahead], gap[ahead], distance[ahead]
        for a, b in zip(one, other, strict=True):
            going[a] = going[b] = False
            loops[loops == loops[b]] = loops[a]
        wide = distance > options.wide * options.spacing
        one, gap, distance = one[wide], gap[wide], distance[wide]
        return front[one] + gap / 2, gap / distance[:, None], distance / 2, one

    def _pace(self, q: Array) -> Array:
        """Lengths of the next steps: no joint reaches its limits on the way unless it is near."""
        # np.clip takes longer than both.
        beyond = np.maximum(self._cell.beyond(self._i, q), self.options.spacing)
        return np.asarray(np.minimum(beyond, self.options.widest))

    def _left(self, q: Array) -> Mask:
        """Mask of postures with a sliding joint beyond its limits: it does not come back."""
        spacing = self.options.spacing
        gone = np.zeros(len(q), dtype=bool)
        for j, joint in enumerate(self._cell.arms[self._i].joints):
            if joint.kind == "prismatic":
                lower, upper = self._cell.lower[self._i][j], self._cell.upper[self._i][j]
                gone |= (q[:, j] < lower - spacing) | (q[:, j] > upper + spacing)
        return gone
