"""Coverage of arms' self-motions with one degree of freedom, limits aside, by loops of points.

Points along all self-motions of arms, from random closed postures: those of one call are traced
together, until each front meets another or what was traced before.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from copose.cell.cell import Cell
from copose.poses import Array, Indices, Mask
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
    widest: float = 1.0  # of points beyond
    closed: float = 1e-6  # residual of postures from which loops are traced, m or rad
    projections: int = 18  # steps that close random postures: more close one in 300
    same: float = 1e-4  # distance of postures that are the same
    aside: float = 0.05  # of a posture on a loop from its tangent, over the spacing there
    bend: float = 1.0  # the same, of loops that bend, over the square of the distance along it
    thinned: float = 0.8  # of the spacing: nearer postures start no loop of their own
    tracing: TracingOptions = field(
        default_factory=lambda: TracingOptions(
            first=1.0, shortest=0.2 / 32, growth=2.0, steps=120, closed=1e-6, straight=0.6,
            very_straight=0.6, aside=0.5, same=1e-3, arc=0.1, room=5.0,
        )
    )  # fmt: skip


class Loops:
    """Points along the self-motions of arms of one model, without regard to their joint limits.

    Many postures are on one loop at a time: each is followed both ways until it meets another, so
    that a loop is closed in a few steps; those of all arms side by side.

    Attributes:
        points: along all loops, (count, n); with no degree of freedom to spare the postures.
        arms: place of the arm of each point among the arms, (count,).
        options: of the steps.
    """

    def __init__(
        self,
        cell: Cell,
        kernels: ArmKernels,
        arms: Sequence[int],
        goals: Array,
        options: LoopOptions = LoopOptions(),
    ) -> None:
        """No loops yet of arms of a cell, by their numbers, with goals of their tips, (k, 7)."""
        self.options = options
        self._kernels, self._goals = kernels, goals
        self._spare = kernels.n > kernels.m
        ranges = [JointRange.of(cell, i) for i in arms]
        self._limits = JointRange(
            np.array([limits.lower for limits in ranges]),
            np.array([limits.upper for limits in ranges]),
            ranges[0].revolute,
        )
        self.points = self._tangents = np.zeros((0, kernels.n))
        self._places, self._squares = np.zeros((0, 2 * kernels.n + 1)), np.zeros(0)
        self._paces = np.zeros(0)
        self.arms = self._loops = self._met = np.zeros(0, dtype=np.intp)

    def count(self, arm: int = 0) -> int:
        """Number of loops of one of the arms."""
        return len(set(self._loops[self.arms == arm].tolist()))

    def innermost(self, beyond: float) -> Array:
        """The point of each loop that is deepest within limits, (count, n).

        Args:
            beyond: distance beyond limits, rad (or m): a loop that is farther everywhere is left
                out.
        """
        depth = self._beyond(self.points, self.arms)
        order = np.lexsort([depth, self._loops])
        first = np.unique(self._loops[order], return_index=True)[1]
        rows = order[first]
        return np.asarray(self.points[rows[depth[rows] <= beyond]])

    def closed(self, q: Array, arms: Indices) -> tuple[Array, Indices]:
        """Postures, (count, n), of the arms in these places, (count,), projected onto their
        self-motions, and their arms; those that cannot be are left out.
        """
        free, options = np.full(self._kernels.n, np.inf), self.options
        ends, gaps = project(
            self._kernels, q, self._goals[arms], -free, free,
            steps=options.projections, closed=options.closed,
        )  # fmt: skip
        closed = (gaps < options.closed) & np.isfinite(ends).all(axis=1)
        return ends[closed], arms[closed]

    def add(self, q: Array, arms: Indices) -> Mask:
        """Follow closed postures, (count, n), of arms, (count,), that are on no known loop.

        Returns:
            Which arms may have more loops, (k,): while no loop has been met just once, random
            postures hardly miss one (I. J. Good, 1953).
        """
        new = self._nearest(q, arms) < 0
        if new.any() and self._spare:
            self._follow(*self._spread(q[new], arms[new]))
        elif new.any():
            self._keep_apart(q[new], arms[new])
        points = self._nearest(q, arms)
        self._met = np.concatenate([self._met, points[points >= 0]])
        _, first, times = np.unique(self._loops[self._met], return_index=True, return_counts=True)
        more = np.ones(len(self._goals), dtype=bool)
        of = self.arms[self._met[first]]
        more[of] = False
        more[of[times == 1]] = True
        return more

    def _spread(self, q: Array, arms: Indices) -> tuple[Array, Indices]:
        """Postures that keep a distance from each other: others add nothing to a loop."""
        places = self._placed(q, arms)
        square = (places**2).sum(axis=1)
        apart = self.options.thinned * self.options.spacing
        near = square[:, None] + square - 2 * places @ places.T <= apart**2
        # Most have room: only the others have to be taken one by one.
        kept = near.sum(axis=1) <= 1
        kept[far_apart_rows(~kept, near)] = True
        return q[kept], arms[kept]

    def _keep_apart(self, q: Array, arms: Indices) -> None:
        """Add isolated postures, each once."""
        same = np.full(1, self.options.same)
        for row, arm, place in zip(q, arms, self._placed(q, arms), strict=True):
            if np.all(np.linalg.norm(self._places - place, axis=1) > same):
                number = np.array([self._loops.max(initial=-1) + 1])
                self._remember(row[None], 0 * row[None], same, number, np.array([arm]))

    def _remember(
        self, points: Array, tangents: Array, paces: Array, loops: Indices, arms: Indices
    ) -> None:
        """Add points with their tangents, spacings, and the numbers of their loops and arms."""
        places = self._placed(points, arms)
        self.points, self._places = (
            np.vstack(pair) for pair in ((self.points, points), (self._places, places))
        )
        self._squares = (self._places**2).sum(axis=1)
        self._tangents = np.vstack([self._tangents, tangents])
        self._paces = np.concatenate([self._paces, paces])
        self._loops = np.concatenate([self._loops, loops])
        self.arms = np.concatenate([self.arms, arms])

    def _placed(self, q: Array, arms: Indices) -> Array:
        """Postures as points that turns do not move; those of two arms are far from each other."""
        far = 100.0  # rad or m: no two postures of an arm are farther apart
        return np.hstack([self._turning.embedded(q), far * arms[:, None]])

    def _nearest(self, q: Array, arms: Indices) -> Indices:
        """The number of the point of a loop next to each posture on a loop, −1 of others."""
        if len(self.points) == 0 or len(q) == 0:
            return np.full(len(q), -1)
        nearest = (2 * self._placed(q, arms) @ self._places.T - self._squares).argmax(axis=1)
        offset = self._turning.wrapped(q - self.points[nearest])
        along = (offset * self._tangents[nearest]).sum(axis=1)
        aside = np.linalg.norm(offset - along[:, None] * self._tangents[nearest], axis=1)
        options, paces = self.options, self._paces[nearest]
        near = (np.abs(along) < paces + options.same) & (self.arms[nearest] == arms)
        near &= aside < options.aside * paces + options.bend * along**2
        return np.where(near, nearest, -1)

    def _follow(self, seeds: Array, arms: Indices) -> None:
        """Add points along the self-motions through closed postures, both ways until they meet."""
        fronts = Fronts(
            self._manifold.taken(arms),
            seeds,
            self.options.tracing,
            groups=arms,
            longest=lambda q, number: self._pace(q, arms[number]),
        )
        pairs, known = list[tuple[int, int]](), int(self._loops.max(initial=-1)) + 1
        while fronts.advance():
            rows = fronts.going.nonzero()[0]
            points = self._nearest(fronts.q[rows], arms[fronts.seeds[rows]])
            met = points >= 0
            fronts.going[rows[met]] = False
            seeded, loops = known + fronts.seeds[rows[met]], self._loops[points[met]]
            pairs += zip(seeded.tolist(), loops.tolist(), strict=True)
        pairs += [(known + one, known + other) for one, other in fronts.meetings]
        rows, passed, tangents, paces = (
            np.concatenate(part) for part in zip(*fronts.trail, strict=True)
        )
        seeded = fronts.seeds[rows]
        self._remember(passed, tangents, paces, known + seeded, arms[seeded])
        self._loops = _joined(known + len(seeds), pairs)[self._loops]

    @cached_property
    def _manifold(self) -> ClosureManifold:
        """The closures, without limits but a margin beyond those of sliding joints."""
        margin = self.options.spacing
        low, high = self._limits.freed
        revolute = np.tile(self._limits.revolute, (len(low), 1))
        return ClosureManifold(self._kernels, self._goals, low - margin, high + margin, revolute)

    @cached_property
    def _turning(self) -> ClosureManifold:
        """The manifold of the first arm: turns of joints are alike in all of one model."""
        return self._manifold.many(1)

    def _beyond(self, q: Array, arms: Indices) -> Array:
        """Distance of the worst joint beyond its limits, (count,), negative within them."""
        limits = self._limits
        offset = self._turning.wrapped(q - limits.middle[arms])
        return np.asarray((np.abs(offset) - limits.half[arms]).max(axis=1))

    def _pace(self, q: Array, arms: Indices) -> Array:
        """Lengths of the next steps: no joint reaches its limits on the way unless it is near."""
        # np.clip takes longer than both.
        beyond = np.maximum(self._beyond(q, arms), self.options.spacing)
        return np.asarray(np.minimum(beyond, self.options.widest))


def _joined(count: int, pairs: Iterable[tuple[int, int]]) -> Indices:
    """The number of the set that each of some numbers is in, pairs being in one, (count,)."""
    sets = np.arange(count)
    one, other = np.array([*pairs], dtype=np.intp).reshape(-1, 2).T
    while (sets[one] != sets[other]).any():
        least = np.minimum(sets[one], sets[other])
        # Whole sets join, not the numbers alone.
        np.minimum.at(sets, sets[one], least)
        np.minimum.at(sets, sets[other], least)
        sets = sets[sets]
    return np.unique(sets, return_inverse=True)[1]
