"""All postures of one arm that hold the object: its self-motions, sampled evenly.

With no degree of freedom to spare they are points, with one they are loops in the space of joint
angles modulo whole turns. Joint limits cut loops into pieces, some of them tiny, but a loop is met
from nearly every random posture: so loops are followed as if there were no limits, and what the
limits leave of them is kept. With more to spare the manifold is sampled at random.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.cell.cell import Cell
from copose.poses import Array, Indices
from copose.robots import finite_range
from copose.robots.reach_bounds import out_of_reach
from copose.self_motion.curves.loops import Loops
from copose.self_motion.kernels import ArmKernels
from copose.self_motion.least_squares import nearest
from copose.self_motion.projection import CLOSED, project


@dataclass(frozen=True)
class SamplingOptions:
    """Sampling of closed postures, and the search for misses where none closes."""

    seed_postures: int = 8  # of which the first that stays within limits is the seed's
    same: float = 1e-6  # difference of joints that are the same, rad or m
    hopeless: int = 1  # number of the batch after which misses are looked for if nothing has closed
    missing_batch: int = 128  # random postures projected at a time where none closes
    nearest: int = 12  # of them, brought as near as they come
    repeated: int = 12  # of these, that end in the nearest miss before no more are drawn
    one_miss: float = 1e-4  # difference of gaps that are one miss, m or rad
    closing: float = 1e-6  # gap of a miss that may yet close, m or rad


@dataclass(frozen=True, eq=False)
class ArmSample:
    """Postures of one arm that hold the object."""

    closed: Array  # within limits, (count, n); the first is that which the seed gives
    neighbours: Indices  # indices of those next to each, (count, k)
    tried: int  # random postures that were projected
    branches: int | None  # self-motions found, None where they were not told apart
    missed: Array  # where no posture closes, local minima of the gap within limits, nearest first
    proved: bool = False  # whether none can, for links are too short, or too long


@dataclass(frozen=True, eq=False)
class ArmSampler:
    """Sampler of the self-motions of arm i of a cell."""

    cell: Cell  # with the object where it is
    kernels: ArmKernels  # of the arm
    i: int  # its number
    goal: Array  # of its tip, see `KernelInputs`
    options: SamplingOptions = SamplingOptions()

    def sample(
        self, rng: np.random.Generator, batch: int, batches: int, most: int, insistence: int
    ) -> ArmSample:
        """Draw batches of postures until they seem to have met every self-motion.

        Args:
            rng: draws the postures.
            batch: postures a batch.
            batches: at most.
            most: postures that are kept, at most.
            insistence: postures drawn before the arm is said to miss its grasp, at most.
        """
        if self.proved:
            return self._proved(rng, insistence)
        loops = Loops(self.cell, self.kernels, self.i, self.goal)
        simple = self.kernels.n - self.kernels.m <= 1
        first = points = missed = np.zeros((0, self.kernels.n))
        tried = closed = 0
        for number in range(batches):
            tried += batch
            q = loops.closed(self.draw(rng, batch))
            closed += len(q)
            if number == self.options.hopeless and not closed and insistence:
                q, missed, drawn = self._insist(rng, insistence)
                tried += drawn
                if not len(q):
                    break
            if simple:
                unfinished = loops.add(q)
            else:
                points = np.vstack([points, self._kept(q)])
                unfinished = len(points) < most
            if len(first) == 0:
                inside = q[self.cell.beyond(self.i, q) <= 0]
                first = self._kept(inside[: self.options.seed_postures], 0.0)[:1]
            if not unfinished:
                break
        if simple:
            points = self._kept(loops.points, 2 * loops.options.spacing)
        start = self.cell.arms[self.i].start
        if start is not None:
            points = np.vstack([self._kept(start[None]), points])
        if len(first):
            points = points[(np.abs(points - first) > self.options.same).any(axis=1)]
        points = np.vstack([first, thinned(points, most)])
        if len(points) == 0 and insistence and not len(missed):
            points, missed, drawn = self._insist(rng, insistence)
            tried += drawn
        return ArmSample(
            closed=points,
            neighbours=neighbours(self.cell, self.kernels, self.i, points),
            tried=tried,
            branches=loops.count if simple else None,
            missed=missed,
        )

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Random postures within limits, closed or not, (count, n)."""
        low, high = finite_range(self.cell.lower[self.i], self.cell.upper[self.i])
        return rng.uniform(low, high, (count, len(low)))

    def _kept(self, q: Array, near: float = np.inf) -> Array:
        """Closed postures within limits, (k, n), some of them projected onto a limit.

        Args:
            q: postures without regard to limits, (count, n).
            near: distance beyond a limit up to which a posture is projected, rad (or m).
        """
        lower, upper = self.cell.lower[self.i], self.cell.upper[self.i]
        q = self.cell.folded(self.i, q)
        beyond = np.maximum(np.maximum(lower - q, q - upper), 0.0).max(axis=1)
        ends, gaps = project(
            self.kernels, q[beyond <= near], self.goal, lower, upper, steps=20, closed=1e-10
        )
        # Points beyond a limit often end in the same corner.
        moved = beyond[beyond <= near] > 0
        closed = gaps < CLOSED
        rows = np.flatnonzero(closed & moved)
        places = self.cell.embedded(self.i, ends[rows]).round(6)
        once = np.unique(places, axis=0, return_index=True)[1]
        closed[np.delete(rows, once)] = False
        return np.asarray(ends[closed])

    @property
    def proved(self) -> bool:
        """True if a bound proves that no posture holds the object."""
        cell, i = self.cell, self.i
        return out_of_reach(
            cell.arms[i], cell.lower[i], cell.upper[i], self.goal, rigid=cell.system.space.rigid
        )

    def _proved(self, rng: np.random.Generator, insistence: int) -> ArmSample:
        """No postures, and the nearest misses where they are asked for."""
        nothing = np.zeros((0, self.kernels.n))
        return ArmSample(
            closed=nothing,
            neighbours=np.zeros((0, 0), dtype=np.intp),
            tried=self.options.missing_batch if insistence else 0,
            branches=0 if self.kernels.n - self.kernels.m <= 1 else None,
            missed=self._nearest(self.draw(rng, self.options.missing_batch))[0]
            if insistence
            else nothing,
            proved=True,
        )

    def _nearest(self, drawn: Array) -> tuple[Array, Array]:
        """Local minima of the gap from the nearest postures drawn, least first, and the gaps."""
        lower, upper = self.cell.lower[self.i], self.cell.upper[self.i]
        q, gaps = project(self.kernels, drawn, self.goal, lower, upper, steps=12)
        best = np.argsort(gaps, kind="stable")[: self.options.nearest]
        q, gaps = nearest(self.kernels, q[best], self.goal, lower, upper)
        order = np.argsort(gaps, kind="stable")
        return q[order], gaps[order]

    def _insist(self, rng: np.random.Generator, count: int) -> tuple[Array, Array, int]:
        """The search for postures that close within limits after all.

        It ends early once the nearest miss has been met again and again.

        Returns:
            Closed postures, misses where there are none, and the number of postures drawn.
        """
        options = self.options
        lower, upper = self.cell.lower[self.i], self.cell.upper[self.i]
        drawn = ends = np.zeros((0, self.kernels.n))
        gaps = np.zeros(0)
        while len(drawn) < count:
            batch = self.draw(rng, options.missing_batch)
            drawn = np.vstack([drawn, batch])
            q, left = self._nearest(batch)
            ends, gaps = np.vstack([ends, q]), np.concatenate([gaps, left])
            one_miss = gaps <= gaps.min() + options.one_miss
            if gaps.min() <= options.closing or one_miss.sum() >= options.repeated:
                break
        if gaps.min() <= options.closing:
            drawn = np.vstack([drawn, self.draw(rng, max(0, count - len(drawn)))])
            q, left = project(self.kernels, np.vstack([ends, drawn]), self.goal, lower, upper)
            if (left < CLOSED).any():
                return q[left < CLOSED], ends[:0], len(drawn)
        return ends[:0], ends[np.argsort(gaps, kind="stable")], len(drawn)


def neighbours(
    cell: Cell, kernels: ArmKernels, i: int, points: Array, each_way: int = 3
) -> Indices:
    """Indices of the postures next to each posture of arm i, (count, k).

    Args:
        cell: with the arm's limits.
        kernels: of the arm.
        i: its number.
        points: postures, (count, n).
        each_way: neighbours for every degree of freedom to spare.
    """
    k = min(each_way * (kernels.n - kernels.m), len(points) - 1)
    if k <= 0:
        return np.zeros((len(points), 0), dtype=np.intp)
    places = cell.embedded(i, points)
    likeness = 2 * places @ places.T - (places**2).sum(axis=1)
    np.fill_diagonal(likeness, -np.inf)
    return np.argpartition(-likeness, k - 1, axis=1)[:, :k]


def held_sample(cell: Cell, kernels: ArmKernels, i: int, goal: Array) -> ArmSample:
    """The one posture of an arm that is held at its start, closed or not."""
    start = np.asarray(cell.arms[i].start)[None]
    residual, _ = kernels.residual(start, goal)
    closed = bool(np.linalg.norm(residual) <= CLOSED)
    nothing = start[:0]
    return ArmSample(
        closed=start if closed else nothing,
        neighbours=np.zeros((int(closed), 0), dtype=np.intp),
        tried=1,
        branches=None,
        missed=nothing if closed else start,
    )


def thinned(points: Array, most: int) -> Array:
    """Evenly spaced points of a sequence, at most so many."""
    if len(points) <= most:
        return points
    chosen = np.linspace(0, len(points) - 1, most).round().astype(int)
    return np.asarray(points[chosen])
