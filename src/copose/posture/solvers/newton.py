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
from copose.self_motion.tangent_space import Tangent


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

    def local(self, q: Array, weights: Array) -> tuple[Array, Array, Array]:
        """Terms, (rows, s), J, (rows, m, n), and slopes, (rows, n), of the arms of many starts.

        Args:
            q: (count, k, d, n).
            weights: of the terms, (count, s).
        """
        count, k, d, n = q.shape
        m, s = self.kernels.m, weights.shape[1]
        x = np.empty((count, k, d, n + s))
        x[..., :n], x[..., n:] = q, weights[:, None, None]
        given = self._given if d == 1 else np.repeat(self._given, d, axis=0)
        values = self.kernels.local(x.reshape(-1, n + s), _each(given, count))
        J = values[:, s : s + m * n].reshape(-1, m, n)
        return values[:, :s], J, values[:, s + m * n :]

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
        """Evaluate closed postures by group; known are sums, the value's slopes by them, terms."""
        terms = [group.terms(q_group) for group, q_group in zip(self.blocks, q, strict=True)]
        sums = np.asarray(sum(summands.sum(axis=1) for summands in terms) + self.rest)
        both = self.score.slope(sums, self.given)
        return Iterates(q, held, both[:, 0].copy(), [sums, both[:, 1:], *terms])

    def slopes(self, j: int, point: Iterates) -> tuple[Array, Array]:
        """Derivatives of closure and score by the joints of a group."""
        return self.blocks[j].local(point.q[j][:, :, None], point.known[1])[1:]

    @np.errstate(over="ignore", invalid="ignore")
    def direction(self, point: Iterates, tangents: list[Tangent]) -> list[Array]:
        """A Newton step in the tangent spaces that ascends, by group, (count, k, n).

        Curvature that is beyond all numbers is that of a step along the gradient, see `_ascent`.
        """
        count, h = len(point.value), self.options.difference
        sums, slope_by_sums, *known_terms = point.known
        changes, blocks = [], []
        for j, (group, tangent) in enumerate(zip(self.blocks, tangents, strict=True)):
            k, (d, n) = len(group.columns), tangent.basis.shape[1:]
            basis = tangent.basis.reshape(count, k, d, n)
            displaced = point.q[j][:, :, None] + h * basis
            terms, J, slope = group.local(displaced, slope_by_sums)
            J = J.reshape(count * k, d, group.kernels.m, n)
            bend = slope.reshape(count * k, d, n) - tangent.slope[:, None]
            bend -= (tangent.forces[:, None, None] @ (J - tangent.J[:, None]))[:, :, 0]
            curvature = bend @ tangent.basis.transpose(0, 2, 1) / h
            blocks += list(curvature.reshape(count, k, d, d).swapaxes(0, 1))
            change = terms.reshape(count, k, d, sums.shape[1]) - known_terms[j][:, :, None]
            changes.append(change.reshape(count, k * d, sums.shape[1]) / h)
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
