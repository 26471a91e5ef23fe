"""Local maxima of a score over the postures of a cell: an active-set method along self-motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from copose.poses import Array, Indices, Mask
from copose.posture.score import Score
from copose.posture.solvers.active_set import ActiveSet, Iterates, Polished, ascent
from copose.self_motion.kernels import ArmKernels
from copose.self_motion.projection import CLOSED, project
from copose.self_motion.tangent_space import ChainTangent, Tangent


@dataclass(frozen=True, eq=False)
class ArmGroup:
    """Arms of one model, which take every step side by side.

    Attributes:
        kernels: of the model.
        columns: of each arm's joints among all of them, (k, n).
        goals: of the tips, see `KernelInputs`, (k, 7).
        ties: to the object, alike, (k, 2m² + n).
        lower: joint limits, infinite where a joint can turn all the way, (k, n).
        upper: alike.
    """

    kernels: ArmKernels
    columns: Indices
    goals: Array
    ties: Array
    lower: Array
    upper: Array

    def terms(self, q: Array) -> Array:
        """Terms of the arms in the sums, (count, k, s), at q, (count, k, n)."""
        count, k, n = q.shape
        return self.kernels.terms(q.reshape(-1, n), _each(self.ties, count)).reshape(count, k, -1)

    def tangent(self, q: Array, weights: Array, held: Mask) -> ChainTangent:
        """The tangent spaces of the arms of many starts, side by side.

        Args:
            q: (count, k, n).
            weights: of the terms, (count, s).
            held: joints that are stopped, (count · k, n).
        """
        (count, k, n), kernels = q.shape, self.kernels
        x = np.empty((count, k, n + weights.shape[1]))
        x[..., :n], x[..., n:] = q, weights[:, None]
        x, given = x.reshape(count * k, -1), _each(self._given, count)
        return ChainTangent.at(kernels, x, given, held)

    @cached_property
    def _given(self) -> Array:
        """Goals and ties, (k, 7 + 2m² + n)."""
        return np.hstack([self.goals, self.ties])


@dataclass(frozen=True, eq=False)
class Polisher(ActiveSet):
    """An active-set method that maximises a score over the postures of a cell.

    Attributes:
        blocks: the arms that move.
        score: of the sums of all arms' terms.
        given: what the score's kernels take beside the sums.
        rest: what arms that do not move add to the sums, (s,).
    """

    blocks: Sequence[ArmGroup]
    score: Score
    given: Array
    rest: Array | float

    def polish(self, q: Array, race: Sequence[tuple[int, int]] = ()) -> Polished:
        """Climb from closed postures, (count, N), to local maxima, see `ActiveSet.polish`."""
        if self.blocks:
            return super().polish(q, race)
        sums = np.broadcast_to(self.rest, (len(q), np.size(self.rest)))
        value = self.score.slope(sums, self.given)[:, 0]
        met = np.ones(len(q), dtype=np.intp)
        return Polished(q, value, np.zeros(len(q)), met, self.options.tolerance)

    def point(self, q: list[Array], held: list[Mask]) -> Iterates:
        """Evaluate closed postures by group; known are sums and the value's slopes by them."""
        terms = (group.terms(q_group) for group, q_group in zip(self.blocks, q, strict=True))
        sums = np.asarray(sum(summands.sum(axis=1) for summands in terms) + self.rest)
        both = self.score.slope(sums, self.given)
        return Iterates(q, held, both[:, 0].copy(), [sums, both[:, 1:]])

    def tangent(self, j: int, point: Iterates, held: Mask) -> Tangent:
        """The tangent spaces of a group."""
        return self.blocks[j].tangent(point.q[j], point.known[1], held)

    @np.errstate(over="ignore", invalid="ignore")
    def direction(self, point: Iterates, tangents: Sequence[Tangent]) -> list[Array]:
        """A Newton step in the tangent spaces that ascends, by group, (count, k, n).

        Curvature that is beyond all numbers is that of a step along the gradient, see `ascent`.
        """
        count, h = len(point.value), self.options.difference
        sums, slope_by_sums = point.known[:2]
        changes, blocks = [], []
        for group, tangent in zip(self.blocks, tangents, strict=True):
            assert isinstance(tangent, ChainTangent)
            k, d = len(group.columns), tangent.basis.shape[1]
            blocks += list(tangent.bend.reshape(count, k, d, d).swapaxes(0, 1))
            changes.append(tangent.change.reshape(count, k * d, sums.shape[1]))
        change = np.concatenate(changes, axis=1)
        free = change.shape[1]
        if free == 0:
            return [np.zeros_like(q) for q in point.q]
        shifted = sums[:, None] + h * change
        weights = self.score.slope(shifted.reshape(count * free, -1), self.given)[:, 1:]
        bent = weights.reshape(count, free, -1) - slope_by_sums[:, None]
        H = bent @ change.transpose(0, 2, 1) / h
        first = 0
        for block in blocks:
            last = first + block.shape[1]
            H[:, first:last, first:last] += block
            first = last
        gradient = np.concatenate(
            [
                (t.basis @ t.slope[:, :, None]).reshape(count, t.basis.shape[1] * len(c.columns))
                for c, t in zip(self.blocks, tangents, strict=True)
            ],
            axis=1,
        )
        step = ascent(H, gradient, self.options.flattest)
        direction, first = [], 0
        for group, tangent in zip(self.blocks, tangents, strict=True):
            k, (d, n) = len(group.columns), tangent.basis.shape[1:]
            part = step[:, first : first + k * d].reshape(count * k, 1, d)
            direction.append((part @ tangent.basis).reshape(count, k, n))
            first += k * d
        return direction

    def closed(self, j: int, q: Array, lower: Array, upper: Array) -> tuple[Array, Mask]:
        """Arms of a group projected onto their closures, and which starts close."""
        group, (count, _, n) = self.blocks[j], q.shape
        lower, upper = (
            limit.reshape(-1, n) if limit.ndim == 3 else _each(limit, count)
            for limit in (lower, upper)
        )
        end, gap = project(
            group.kernels, q.reshape(-1, n), _each(group.goals, count), lower, upper, steps=12,
            closed=self.options.closed,
        )  # fmt: skip
        closes = (gap < CLOSED).reshape(q.shape[:2]).all(axis=1)
        return end.reshape(q.shape), np.asarray(closes)


def _each(values: Array, count: int) -> Array:
    """Values of the arms, (k, n), so many times one after the other, (count · k, n)."""
    if count == 1:
        return values
    # A tenth of the time that np.tile takes.
    repeated = np.empty((count, *values.shape))
    repeated[:] = values
    return repeated.reshape(-1, values.shape[1])
