"""All postures of one arm that hold the object: its self-motions, sampled evenly.

With no degree of freedom to spare they are points, with one they are loops in the space of joint
angles modulo whole turns. Joint limits cut loops into pieces, some of them tiny, but a loop is met
from nearly every random posture: so loops are followed as if there were no limits, and what the
limits leave of them is kept. With more to spare the manifold is sampled at random.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from copose.cell.cell import Cell
from copose.poses import Array, Indices, Mask
from copose.robots import finite_range
from copose.robots.reach_bounds import out_of_reach
from copose.self_motion.curves.loops import Loops
from copose.self_motion.kernels import ArmKernels
from copose.self_motion.least_squares import nearest
from copose.self_motion.projection import CLOSED, project


@dataclass(frozen=True)
class SamplingOptions:
    """Sampling of closed postures, and the search for misses where none closes."""

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
    complete: bool = False  # whether slices are to meet every self-motion, where they can
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
        return sample_together([self], [rng], batch, batches, most, insistence)[0]

    @property
    def sliced(self) -> Array:
        """Closed postures of slices that meet every self-motion, (count, n); none where no cut
        works for the arm.
        """
        # Only a search that is to be complete slices.
        from copose.self_motion.slices.sliced_arm import SlicedArm

        slices = SlicedArm(self.cell.arms[self.i], self.kernels, self.cell.system.space)
        if slices.fault is not None:
            return np.zeros((0, self.kernels.n))
        return slices.at(self.goal).postures

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Random postures within limits, closed or not, (count, n)."""
        low, high = finite_range(self.cell.lower[self.i], self.cell.upper[self.i])
        return rng.uniform(low, high, (count, len(low)))

    @cached_property
    def proved(self) -> bool:
        """True if a bound proves that no posture holds the object."""
        cell, i = self.cell, self.i
        return out_of_reach(
            cell.arms[i], cell.lower[i], cell.upper[i], self.goal, rigid=cell.system.space.rigid
        )

    def nothing(self, rng: np.random.Generator, insistence: int) -> ArmSample:
        """No postures, where that is proved, and the nearest misses where they are asked for."""
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

    def insist(self, rng: np.random.Generator, count: int) -> tuple[Array, Array, int]:
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


@dataclass(eq=False)
class _Growing:
    """The sample of one arm as it grows."""

    sampler: ArmSampler
    rng: np.random.Generator  # draws postures
    first: Array  # the first closed posture within limits, once there is one, (1, n)
    points: Array  # postures so far, where they are not those of loops, (count, n)
    missed: Array  # see `ArmSample`; ``tried`` alike
    tried: int = 0
    closed: int = 0  # postures so far that were closed, within limits or not

    @classmethod
    def of(cls, sampler: ArmSampler, rng: np.random.Generator) -> _Growing:
        """Nothing yet."""
        nothing = np.zeros((0, sampler.kernels.n))
        return cls(sampler, rng, nothing, nothing, nothing)

    def drawn(self, count: int) -> Array:
        """Random postures, (count, n)."""
        self.tried += count
        return self.sampler.draw(self.rng, count)

    def closing(self, q: Array, number: int, insistence: int) -> Array | None:
        """Closed postures of a batch, (count, n); None where the arm seems to miss its grasp."""
        self.closed += len(q)
        if number != self.sampler.options.hopeless or self.closed or not insistence:
            return q
        q, self.missed, drawn = self.sampler.insist(self.rng, insistence)
        self.tried += drawn
        return q if len(q) else None

    def begin(self, q: Array) -> None:
        """Take the first of closed postures, (count, n), that is within limits."""
        if not len(self.first):
            self.first = q[self.sampler.cell.beyond(self.sampler.i, q) <= 0][:1]

    def sample(self, points: Array, branches: int | None, most: int, insistence: int) -> ArmSample:
        """The sample, of points within limits, (count, n), the seed's before all others."""
        sampler, first, points = self.sampler, points[:1], points[1:]
        start = sampler.cell.arms[sampler.i].start
        if start is not None:
            points = np.vstack([*kept([sampler], [start[None]]), points])
        if len(first):
            points = points[(np.abs(points - first) > sampler.options.same).any(axis=1)]
        points = np.vstack([first, thinned(points, most)])
        if len(points) == 0 and insistence and not len(self.missed):
            points, self.missed, drawn = sampler.insist(self.rng, insistence)
            self.tried += drawn
        near = neighbours(sampler.cell, sampler.kernels, sampler.i, points)
        return ArmSample(points, near, self.tried, branches, self.missed)


def sample_together(
    samplers: Sequence[ArmSampler],
    rngs: Sequence[np.random.Generator],
    batch: int,
    batches: int,
    most: int,
    insistence: int,
) -> list[ArmSample]:
    """Samples of arms of one model, side by side, see `ArmSampler.sample`."""
    proved = [sampler.proved for sampler in samplers]
    every = zip(samplers, rngs, proved, strict=True)
    growing = [_Growing.of(sampler, rng) for sampler, rng, none in every if not none]
    grown = iter(_grown(growing, batch, batches, most, insistence) if growing else ())
    return [
        sampler.nothing(rng, insistence) if none else next(grown)
        for sampler, rng, none in zip(samplers, rngs, proved, strict=True)
    ]


def _grown(
    growing: Sequence[_Growing], batch: int, batches: int, most: int, insistence: int
) -> list[ArmSample]:
    """Samples of arms that no bound keeps from their grasps."""
    arms = [each.sampler for each in growing]
    kernels, goals = arms[0].kernels, np.array([sampler.goal for sampler in arms])
    loops = Loops(arms[0].cell, kernels, [sampler.i for sampler in arms], goals)
    _grow(growing, loops, batch, batches, most, insistence)
    if kernels.n - kernels.m > 1:
        begun = kept(arms, [each.first for each in growing])
        return [
            each.sample(np.vstack([first, each.points]), None, most, insistence)
            for each, first in zip(growing, begun, strict=True)
        ]
    for k, sampler in enumerate(arms):
        sliced = sampler.sliced if sampler.complete else np.zeros((0, kernels.n))
        if len(sliced):
            loops.add(sliced, np.full(len(sliced), k))
    every = [
        np.vstack([each.first, loops.points[loops.arms == k]]) for k, each in enumerate(growing)
    ]
    points = kept(arms, every, 2 * loops.options.spacing)
    return [
        each.sample(points[k], loops.count(k), most, insistence) for k, each in enumerate(growing)
    ]


def _grow(
    growing: Sequence[_Growing], loops: Loops, batch: int, batches: int, most: int, insistence: int
) -> None:
    """Draw batches of postures for each arm until they seem to have met all its self-motions."""
    going = list(range(len(growing)))
    for number in range(batches):
        drawn = np.vstack([growing[k].drawn(batch) for k in going])
        q, arms = loops.closed(drawn, np.repeat(going, batch))
        parts = {k: growing[k].closing(q[arms == k], number, insistence) for k in going}
        closed = {k: part for k, part in parts.items() if part is not None}
        going = list(closed)
        if not going:
            break
        if growing[0].sampler.kernels.n - growing[0].sampler.kernels.m <= 1:
            counts = [len(part) for part in closed.values()]
            more = loops.add(np.vstack(list(closed.values())), np.repeat(going, counts))
        else:
            more = np.ones(len(growing), dtype=bool)
            for k, part in closed.items():
                own = growing[k]
                own.points = np.vstack([own.points, *kept([own.sampler], [part])])
                more[k] = len(own.points) < most
        for k, part in closed.items():
            growing[k].begin(part)
        going = [k for k in going if more[k]]
        if not going:
            break


def kept(
    samplers: Sequence[ArmSampler], postures: Sequence[Array], near: float = np.inf
) -> list[Array]:
    """Closed postures within limits, by arm (k, n), some of them projected onto a limit.

    Args:
        samplers: of arms of one model.
        postures: by arm, without regard to limits, (count, n).
        near: distance beyond a limit up to which a posture is projected, rad (or m).
    """
    cell, rows, moved = samplers[0].cell, list[Array](), list[Mask]()
    for sampler, q in zip(samplers, postures, strict=True):
        lower, upper = cell.lower[sampler.i], cell.upper[sampler.i]
        q = cell.folded(sampler.i, q)
        beyond = np.maximum(np.maximum(lower - q, q - upper), 0.0).max(axis=1)
        rows.append(q[beyond <= near])
        moved.append(beyond[beyond <= near] > 0)
    counts = [len(q) for q in rows]
    goals, lower, upper = (
        np.repeat(values, counts, axis=0)
        for values in zip(
            *((sampler.goal, cell.lower[sampler.i], cell.upper[sampler.i]) for sampler in samplers),
            strict=True,
        )
    )
    # What limits stop for good would take all steps that there are; what closes takes few.
    ends, gaps = project(
        samplers[0].kernels, np.vstack(rows), goals, lower, upper, steps=9, closed=1e-10
    )
    within, edges = list[Array](), np.cumsum(counts)[:-1]
    for sampler, q, closed, beside in zip(
        samplers, np.split(ends, edges), np.split(gaps < CLOSED, edges), moved, strict=True
    ):
        at_limit = np.flatnonzero(closed & beside)
        if len(at_limit) > 1:
            # Points beyond a limit often end in the same corner; to add zero makes −0 one.
            places = cell.embedded(sampler.i, q[at_limit]).round(6) + 0.0
            once = {place.tobytes(): row for row, place in zip(at_limit, places, strict=True)}
            closed[at_limit] = False
            closed[list(once.values())] = True
        within.append(q[closed])
    return within


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
