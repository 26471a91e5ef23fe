"""All postures of one arm that hold the object: its self-motions, sampled evenly.

With no degree of freedom to spare they are points, with one they are loops in the space of joint
angles modulo whole turns. Joint limits cut loops into pieces, some of them tiny, but a loop is met
from nearly every random posture: so loops are followed as if there were no limits, and what the
limits leave of them is kept. With more to spare the manifold is sampled at random.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from copose.planning.arm_kernels import ArmKernels
from copose.planning.cell import Cell
from copose.planning.closing import CLOSED, project
from copose.poses import Array, Indices, Mask
from copose.robots import finite_range

# Spacing along a loop, rad (or m): the norm of the joints' differences.
_SPACING = 0.2
_LONGEST_LOOP = 400
_SAME_LOOP = 0.02
_TOGETHER = 8
_NEIGHBOURS = 3
# Postures drawn before an arm is said to miss its grasp, and misses kept.
_INSISTENCE = 4096
_MISSES = 32


@dataclass(frozen=True, eq=False)
class ArmSample:
    """Postures of one arm that hold the object.

    Attributes:
        closed: within limits, (count, n); the first is that which the seed gives.
        neighbours: indices of those next to each, (count, k).
        tried: random postures that were projected.
        branches: self-motions found, None where they were not told apart.
        missed: where no posture closes, random ones projected within limits, nearest first.
    """

    closed: Array
    neighbours: Indices
    tried: int
    branches: int | None
    missed: Array


@dataclass(frozen=True, eq=False)
class ArmSampler:
    """Samples the self-motions of arm i of a cell."""

    cell: Cell
    kernels: ArmKernels
    i: int
    goal: Array

    def sample(self, rng: np.random.Generator, batch: int, batches: int, most: int) -> ArmSample:
        """Draw batches of postures until one of them meets no new self-motion, or all are drawn.

        Args:
            rng: draws the postures.
            batch: postures a batch.
            batches: at most.
            most: postures that are kept, at most.
        """
        spare = self.kernels.n - self.kernels.m
        loops: list[Array] = []
        points = np.zeros((0, self.kernels.n))
        first = np.zeros((0, self.kernels.n))
        tried = 0
        for _ in range(batches):
            drawn = self._draw(rng, batch)
            tried += batch
            free = np.full(self.kernels.n, np.inf)
            q, gaps = project(self.kernels, drawn, self.goal, -free, free, steps=25)
            q = q[gaps < CLOSED]
            q = q[np.isfinite(q).all(axis=1)]
            if spare > 1:
                points = np.vstack([points, self._kept(q)])
                first = points[:1]
                if len(points) >= most:
                    break
                continue
            if len(first) == 0:
                first = self._kept(q)[:1]
            new = self._loops(q, loops)
            loops += new
            if not new:
                break
        if spare <= 1 and loops:
            points = self._kept(np.vstack(loops), 2 * _SPACING)
        start = self.cell.arms[self.i].start
        if start is not None:
            points = np.vstack([self._kept(start[None]), points])
        points = np.vstack([first, _thinned(points, most)])
        missed = points[:0]
        if len(points) == 0:
            points, missed = self._insist(rng)
            tried += _INSISTENCE
        return ArmSample(
            closed=points,
            neighbours=self._neighbours(points),
            tried=tried,
            branches=len(loops) if spare <= 1 else None,
            missed=missed,
        )

    def _insist(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """Postures that close within limits after all, and the nearest of those that do not."""
        lower, upper = self.cell.lower[self.i], self.cell.upper[self.i]
        drawn = self._draw(rng, _INSISTENCE)
        q, gaps = project(self.kernels, drawn, self.goal, lower, upper)
        order = np.argsort(gaps, kind="stable")
        closed = order[gaps[order] < CLOSED]
        return q[closed], q[order[len(closed) :][:_MISSES]]

    def _draw(self, rng: np.random.Generator, count: int) -> Array:
        low, high = finite_range(self.cell.lower[self.i], self.cell.upper[self.i])
        return rng.uniform(low, high, (count, len(low)))

    def _kept(self, q: Array, near: float = np.inf) -> Array:
        """What limits leave of closed postures, and those that end where a limit stops them.

        Args:
            q: postures without regard to limits, (count, n).
            near: how far beyond a limit a posture may be to be projected onto it.
        """
        lower, upper = self.cell.lower[self.i], self.cell.upper[self.i]
        q = self.cell.folded(self.i, q)
        beyond = np.maximum(np.maximum(lower - q, q - upper), 0.0).max(axis=1)
        ends, gaps = project(
            self.kernels, q[(beyond > 0) & (beyond <= near)], self.goal, lower, upper, steps=25
        )
        return np.vstack([q[beyond == 0], ends[gaps < CLOSED]])

    def _loops(self, q: Array, known: list[Array]) -> list[Array]:
        """Self-motions through postures that are on none of the known ones."""
        found: list[Array] = []
        for loop in known:
            q = q[~self._on(loop, q)]
        while len(q):
            seeds = self._apart(q)
            for loop in self._trace(seeds):
                if not any(self._on(other, loop[len(loop) // 2 :][:1])[0] for other in found):
                    found.append(loop)
                q = q[~self._on(loop, q)]
            q = q[~(q[:, None] == seeds[None]).all(axis=2).any(axis=1)]
        return found

    def _apart(self, q: Array) -> Array:
        """A few postures that differ clearly."""
        chosen = [q[0]]
        for other in q[1:]:
            if len(chosen) == _TOGETHER:
                break
            if (
                np.linalg.norm(
                    self.cell.nearest_turn(self.i, other - np.array(chosen)), axis=1
                ).min()
                > 1
            ):
                chosen.append(other)
        return np.array(chosen)

    def _on(self, loop: Array, q: Array) -> Mask:
        """Whether postures, (count, n), lie on a self-motion given by points along it."""
        turn = self.cell.nearest_turn
        along = turn(self.i, np.roll(loop, -1, axis=0) - loop)
        square = np.maximum((along**2).sum(axis=1), 1e-300)
        # What was not closed has no segment from its end to its beginning.
        along[square > (3 * _SPACING) ** 2] = 0.0
        offset = turn(self.i, q[:, None] - loop[None])
        where = np.clip((offset * along).sum(axis=2) / square, 0.0, 1.0)
        gap = np.linalg.norm(offset - where[:, :, None] * along, axis=2).min(axis=1)
        return np.asarray(gap < (_SAME_LOOP if len(loop) > 1 else 1e-6))

    def _trace(self, seeds: Array) -> Iterator[Array]:
        """Points along the self-motions through some closed postures, both ways until they meet."""
        if self.kernels.n <= self.kernels.m:
            yield from (seed[None] for seed in seeds)
            return
        count, n = seeds.shape
        _, J = self.kernels.residual(seeds, self.goal)
        tangents = np.linalg.svd(J)[2][:, -1]
        front = np.repeat(seeds, 2, axis=0)
        heading = np.stack([tangents, -tangents], axis=1).reshape(-1, n)
        spacing = np.full(2 * count, _SPACING)
        trails: list[list[Array]] = [[] for _ in front]
        going = np.ones(2 * count, dtype=bool)
        free, beyond = np.full(n, np.inf), self._left
        for _ in range(_LONGEST_LOOP):
            rows = np.flatnonzero(going)
            if len(rows) == 0:
                break
            guess = front[rows] + spacing[rows, None] * heading[rows]
            ends, gaps = project(self.kernels, guess, self.goal, -free, free, steps=8, closed=1e-10)
            moved = ends - front[rows]
            length = np.linalg.norm(moved, axis=1)
            straight = (moved * heading[rows]).sum(axis=1) / np.maximum(length, 1e-300)
            good = (gaps < CLOSED) & (straight > 0.8) & (length < 1.5 * spacing[rows])
            spacing[rows] = np.where(
                good, np.minimum(1.5 * spacing[rows], _SPACING), spacing[rows] / 2
            )
            for row, end, step in zip(rows[good], ends[good], moved[good], strict=True):
                trails[row].append(end)
                heading[row] = step / np.linalg.norm(step)
            front[rows[good]] = ends[good]
            going[rows[spacing[rows] < _SPACING / 32]] = False
            going[rows[beyond(front[rows])]] = False
            going &= np.repeat(~self._met(front, heading, trails), 2)
        for k, seed in enumerate(seeds):
            ahead, behind = trails[2 * k], trails[2 * k + 1]
            yield np.array([*reversed(behind), seed, *ahead])

    def _met(self, front: Array, heading: Array, trails: list[list[Array]]) -> Mask:
        """By pairs of fronts that set out in opposite directions: whether they closed a loop."""
        gap = self.cell.nearest_turn(self.i, front[1::2] - front[::2])
        distance = np.linalg.norm(gap, axis=1)
        aligned = np.abs((gap * heading[::2]).sum(axis=1)) > 0.8 * distance
        facing = (heading[::2] * heading[1::2]).sum(axis=1) < -0.7
        far = np.array([len(trail) >= 3 for trail in trails[::2]])
        return np.asarray(far & facing & aligned & (distance < 1.2 * _SPACING))

    def _left(self, q: Array) -> Mask:
        """Whether a sliding joint has left its limits: it does not come back by itself."""
        joints = enumerate(self.cell.arms[self.i].joints)
        gone = np.zeros(len(q), dtype=bool)
        for j in (j for j, joint in joints if joint.kind == "prismatic"):
            lower, upper = self.cell.lower[self.i][j], self.cell.upper[self.i][j]
            gone |= (q[:, j] < lower - _SPACING) | (q[:, j] > upper + _SPACING)
        return gone

    def _neighbours(self, points: Array) -> Indices:
        """Indices of the nearest other points, (count, k)."""
        offset = self.cell.nearest_turn(self.i, points[:, None] - points[None])
        distance = (offset**2).sum(axis=2)
        np.fill_diagonal(distance, np.inf)
        k = min(_NEIGHBOURS * (self.kernels.n - self.kernels.m), len(points) - 1)
        if k <= 0:
            return np.zeros((len(points), 0), dtype=np.intp)
        return np.argpartition(distance, k - 1, axis=1)[:, :k]


def _thinned(points: Array, most: int) -> Array:
    """At most so many of the points, evenly in their order."""
    if len(points) <= most:
        return points
    chosen = np.linspace(0, len(points) - 1, most).round().astype(int)
    return np.asarray(points[chosen])
