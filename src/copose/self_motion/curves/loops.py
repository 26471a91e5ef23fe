"""Coverage of an arm's self-motions with one degree of freedom, limits aside, by loops of points.

Points along all self-motions of an arm, from random closed postures: those of one call are traced
together, until each front meets another or what was traced before.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from copose.cell.cell import Cell
from copose.poses import Array, Indices
from copose.selection import far_apart_rows
from copose.self_motion.curves.curve import TracingOptions
from copose.self_motion.curves.joint_range import JointRange
from copose.self_motion.curves.tracing import Fronts
from copose.self_motion.kernels import ArmKernels
from copose.self_motion.manifold import ClosureManifold
from copose.self_motion.projection import project


@dataclass(frozen=True)
class LoopOptions:
    """Distances along loops; norms of differences of joints, rad (or m)."""

    spacing: float = 0.2  # of points within limits or near them
    widest: float = 0.6  # of points beyond
    closed: float = 1e-6  # residual of postures from which loops are traced, m or rad
    projections: int = 25  # steps that close random postures
    same: float = 1e-4  # distance of postures that are the same
    aside: float = 0.05  # of a posture on a loop from its tangent, over the spacing there
    bend: float = 1.0  # the same, of loops that bend, over the square of the distance along it
    thinned: float = 0.8  # of the spacing: nearer postures start no loop of their own
    tracing: TracingOptions = field(
        default_factory=lambda: TracingOptions(
            first=1.0, shortest=0.2 / 32, growth=2.0, steps=120, closed=1e-6, straight=0.8,
            very_straight=0.8, aside=0.3, oriented=False, same=1e-3, arc=0.1,
        )
    )  # fmt: skip


class Loops:
    """Points along the self-motions of an arm without regard to its joint limits.

    Many postures are on one loop at a time: each is followed both ways until it meets another, so
    that a loop is closed in a few steps.

    Attributes:
        count: number of loops.
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
        self.points = self._tangents = np.zeros((0, kernels.n))
        self._places, self._squares = np.zeros((0, 2 * kernels.n)), np.zeros(0)
        self._paces, self.count = np.zeros(0), 0
        self._loops = self._met = np.zeros(0, dtype=np.intp)

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
        free, options = np.full(self._kernels.n, np.inf), self.options
        ends, gaps = project(
            self._kernels, q, self._goal, -free, free,
            steps=options.projections, closed=options.closed,
        )  # fmt: skip
        return np.asarray(ends[(gaps < self.options.closed) & np.isfinite(ends).all(axis=1)])

    def add(self, q: Array) -> bool:
        """Follow closed postures, (count, n), that are on no known loop.

        Returns:
            Whether there may be more: while no loop has been met just once, random postures hardly
            miss one (I. J. Good, 1953).
        """
        new = q[self._nearest(q) < 0]
        if len(new) and self._spare:
            self._follow(self._spread(new))
        elif len(new):
            self._keep_apart(new)
        points = self._nearest(q)
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

    def _keep_apart(self, q: Array) -> None:
        """Add isolated postures, each once."""
        same = self.options.same
        places = self._cell.embedded(self._i, q)
        for row, place in zip(q, places, strict=True):
            if np.all(np.linalg.norm(self._places - place, axis=1) > same):
                number, posture = np.array([self.count]), row[None]
                self._remember(posture, 0 * posture, np.full(1, same), number)
                self.count += 1

    def _remember(self, points: Array, tangents: Array, paces: Array, loops: Indices) -> None:
        """Add points with their tangents, spacings and loops' numbers."""
        places = self._cell.embedded(self._i, points)
        self.points, self._places = (
            np.vstack(pair) for pair in ((self.points, points), (self._places, places))
        )
        self._squares = (self._places**2).sum(axis=1)
        self._tangents = np.vstack([self._tangents, tangents])
        self._paces = np.concatenate([self._paces, paces])
        self._loops = np.concatenate([self._loops, loops])

    def _nearest(self, q: Array) -> Indices:
        """The number of the point of a loop next to each posture on a loop, −1 of others."""
        if len(self.points) == 0 or len(q) == 0:
            return np.full(len(q), -1)
        places = self._cell.embedded(self._i, q)
        nearest = (2 * places @ self._places.T - self._squares).argmax(axis=1)
        offset = self._cell.nearest_turn(self._i, q - self.points[nearest])
        along = (offset * self._tangents[nearest]).sum(axis=1)
        aside = np.linalg.norm(offset - along[:, None] * self._tangents[nearest], axis=1)
        options, paces = self.options, self._paces[nearest]
        near = np.abs(along) < paces + options.same
        near &= aside < options.aside * paces + options.bend * along**2
        return np.where(near, nearest, -1)

    def _follow(self, seeds: Array) -> None:
        """Add points along the self-motions through closed postures, both ways until they meet."""
        fronts = Fronts(
            self._manifold.many(len(seeds)),
            seeds,
            self.options.tracing,
            apart=False,
            longest=self._pace,
        )
        pairs = list[tuple[int, int]]()
        while fronts.advance():
            rows = np.flatnonzero(fronts.going)
            known = self._nearest(fronts.q[rows])
            met = known >= 0
            fronts.going[rows[met]] = False
            seeded, known_loops = self.count + fronts.seeds[rows[met]], self._loops[known[met]]
            pairs += zip(seeded.tolist(), known_loops.tolist(), strict=True)
        pairs += [(self.count + one, self.count + other) for one, other in fronts.meetings]
        rows, points, tangents, paces = (
            np.concatenate(part) for part in zip(*fronts.trail, strict=True)
        )
        self._remember(points, tangents, paces, self.count + fronts.seeds[rows])
        self._loops = _joined(self.count + len(seeds), pairs)[self._loops]
        self.count = int(self._loops.max()) + 1

    @cached_property
    def _manifold(self) -> ClosureManifold:
        """The closure, without limits but a margin beyond those of sliding joints."""
        limits, margin = JointRange.of(self._cell, self._i), self.options.spacing
        low, high = limits.freed
        return ClosureManifold(
            self._kernels, self._goal[None], low[None] - margin, high[None] + margin,
            limits.revolute[None],
        )  # fmt: skip

    def _pace(self, q: Array) -> Array:
        """Lengths of the next steps: no joint reaches its limits on the way unless it is near."""
        # np.clip takes longer than both.
        beyond = np.maximum(self._cell.beyond(self._i, q), self.options.spacing)
        return np.asarray(np.minimum(beyond, self.options.widest))


def _joined(count: int, pairs: Iterable[tuple[int, int]]) -> Indices:
    """The number of the set that each of some numbers is in, pairs being in one, (count,)."""
    parents = list(range(count))

    def first(k: int) -> int:
        while parents[k] != k:
            parents[k] = k = parents[parents[k]]
        return k

    for one, other in pairs:
        low, high = sorted((first(one), first(other)))
        parents[high] = low
    return np.unique([first(k) for k in range(count)], return_inverse=True)[1]
