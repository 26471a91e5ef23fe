"""Local maxima under the closed chain, many at once: Newton steps along the self-motions.

The posture program with its closure solved for: every arm moves in the tangent space of its own
self-motion, Newton's Hessian is that of the Lagrangian in these few directions, joints that limits
stop are held there as long as their multipliers push outwards: an active-set method. Written out
because no library takes steps on closed chains in batches, and IPOPT takes longer to start than
this to end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from copose.poses import Array, Indices, Mask
from copose.posture.score import Score
from copose.self_motion.kernels import ArmKernels
from copose.self_motion.projection import CLOSED, project
from copose.self_motion.tangent_space import Tangent


@dataclass(frozen=True)
class NewtonOptions:
    """Steps and tolerances of the active-set method."""

    tolerance: float = 1e-9  # of optimality, scaled as IPOPT's
    scale: float = 100.0  # of multipliers from which on that scaling sets in
    iterations: int = 60  # steps at most
    halvings: int = 12  # of a step at most
    longest: float = 0.3  # rad or m that a joint moves in one step
    difference: float = 1e-6  # rad or m, step of finite differences
    at_limit: float = 1e-10  # rad or m, that a joint is off a limit that it is brought to
    flattest: float = 1e-8  # curvature, relative to the largest, that counts as this much
    noise: float = 1e-10  # that a value may be off where a chain is open by a little, relative
    closed: float = 1e-11  # m or rad, to which chains are closed


@dataclass(frozen=True, eq=False)
class Polished:
    """Ends of climbs.

    Attributes:
        q: joints of all arms, (count, N).
        value: of the score, (count,).
        error: IPOPT's measure of optimality there, (count,).
        tolerance: of it.
    """

    q: Array
    value: Array
    error: Array
    tolerance: float

    @property
    def converged(self) -> Mask:
        """A mask of the ends that meet IPOPT's tolerance, (count,)."""
        return np.asarray(self.error <= self.tolerance)


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

    def stopped(self, q: Array) -> Mask:
        """A mask of the joints at a limit, (count, k, n)."""
        return np.asarray((q <= self.lower) | (q >= self.upper))


@dataclass(frozen=True, eq=False)
class _Point:
    """Postures and all that the next step takes from them.

    Attributes:
        q: by group, (count, k, n).
        held: by group, joints that are taken to be stopped, (count, k, n).
        terms: by group, (count, k, s).
        value: (count,).
        weights: derivatives of the value by the sums of the terms, (count, s).
    """

    q: list[Array]
    held: list[Mask]
    terms: list[Array]
    sums: Array
    value: Array
    weights: Array

    def taken(self, rows: Mask) -> _Point:
        """The postures of some starts."""
        if rows.all():
            return self
        return _Point(
            [q[rows] for q in self.q],
            [held[rows] for held in self.held],
            [terms[rows] for terms in self.terms],
            self.sums[rows],
            self.value[rows],
            self.weights[rows],
        )

    def put(self, rows: Indices, other: _Point, chosen: Mask) -> None:
        """Replace some of these starts by chosen ones of another."""
        for known, new in (
            *zip(self.q, other.q, strict=True),
            *zip(self.held, other.held, strict=True),
            *zip(self.terms, other.terms, strict=True),
            (self.sums, other.sums),
            (self.value, other.value),
            (self.weights, other.weights),
        ):
            known[rows] = new[chosen]


@dataclass(frozen=True, eq=False)
class Polisher:
    """An active-set method that maximises a score over the postures of a cell.

    Attributes:
        groups: the arms that move.
        score: of the sums of all arms' terms.
        given: what the score's kernels take beside the sums.
        rest: what arms that do not move add to the sums, (s,).
        options: steps and tolerances.
    """

    groups: Sequence[ArmGroup]
    score: Score
    given: Array
    rest: Array | float
    options: NewtonOptions = NewtonOptions()

    def polish(self, q: Array) -> Polished:
        """Climb from closed postures, (count, N), to local maxima."""
        if not self.groups:
            sums = np.broadcast_to(self.rest, (len(q), np.size(self.rest)))
            value = self.score.slope(sums, self.given)[:, 0]
            return Polished(q, value, np.zeros(len(q)), self.options.tolerance)
        value, error = np.full(len(q), -np.inf), np.full(len(q), np.inf)
        ends = Polished(q.copy(), value, error, self.options.tolerance)

        def settle(done: Mask, error: Array) -> None:
            for group, part in zip(self.groups, point.q, strict=True):
                ends.q[rows[done][:, None, None], group.columns] = part[done]
            ends.value[rows[done]], ends.error[rows[done]] = point.value[done], error[done]

        parts = [q[:, group.columns] for group in self.groups]
        stopped = [group.stopped(part) for group, part in zip(self.groups, parts, strict=True)]
        point = self._point(parts, stopped)
        sound = np.isfinite(point.value)
        rows, point = sound.nonzero()[0], point.taken(sound)
        for left in range(self.options.iterations, -1, -1):
            if len(rows) == 0:
                break
            tangents = [self._tangent(j, point) for j in range(len(self.groups))]
            error = self._error(tangents, len(rows))
            done = (error <= self.options.tolerance) | (left == 0)
            if done.any():
                settle(done, error)
                going = ~done
                rows, point, error = rows[going], point.taken(going), error[going]
                if len(rows) == 0:
                    break
                tangents = [
                    tangent.taken(np.repeat(going, len(group.columns)))
                    for group, tangent in zip(self.groups, tangents, strict=True)
                ]
            ahead, moved = self._advance(point, *self._feasible_direction(point, tangents))
            if moved.all():
                point = ahead
            else:
                settle(~moved, error)
                rows, point = rows[moved], ahead.taken(moved)
        return ends

    def _point(self, q: list[Array], held: list[Mask]) -> _Point:
        terms = [group.terms(q_group) for group, q_group in zip(self.groups, q, strict=True)]
        sums = np.asarray(sum(summands.sum(axis=1) for summands in terms) + self.rest)
        both = self.score.slope(sums, self.given)
        return _Point(q, held, terms, sums, both[:, 0].copy(), both[:, 1:])

    def _tangent(self, j: int, point: _Point) -> Tangent:
        """The tangent spaces of a group, with joints let go that gain by leaving their limits."""
        group, q, held = self.groups[j], point.q[j], point.held[j]
        _, J, slope = group.local(q[:, :, None], point.weights)
        if not held.any():
            return Tangent.of(J, slope, held.reshape(slope.shape))
        above, below = q >= group.upper, q <= group.lower
        outward = (above.astype(float) - below).reshape(slope.shape)
        held = (held & (above | below)).reshape(slope.shape)
        return Tangent.of(J, slope, held).released(outward)

    def _error(self, tangents: list[Tangent], count: int) -> Array:
        """IPOPT's scaled dual infeasibility, (count,).

        The largest entry of ∇f + Jᵀλ − z with least-squares multipliers, over
        max(100, mean |λ|, |z|)/100 (A. Wächter, L. T. Biegler, 2006, eq. 5).
        """
        largest, total, entries = 0.0, 0.0, 0
        for tangent in tangents:
            left = np.abs(tangent.left)
            rest = np.where(tangent.held, 0.0, left).reshape(count, -1)
            largest = np.maximum(largest, rest.max(axis=1))
            forces = np.abs(tangent.forces).reshape(count, -1)
            total = total + forces.sum(axis=1)
            total += (left.reshape(count, -1) - rest).sum(axis=1)
            entries += rest.shape[1] + forces.shape[1]
        return np.asarray(largest / np.maximum(1.0, total / entries / self.options.scale))

    def _feasible_direction(
        self, point: _Point, tangents: list[Tangent]
    ) -> tuple[list[Tangent], list[Array]]:
        """A direction that pushes no joint through its limit, and the tangent spaces it is of."""
        direction = self._direction(point, tangents)
        if not any(held.any() for held in point.held):
            return tangents, direction
        for _ in range(max(group.kernels.n for group in self.groups)):
            pushed = [
                ((q >= group.upper) & (step > 0) | (q <= group.lower) & (step < 0)).reshape(
                    tangent.held.shape
                )
                & ~tangent.held
                for group, q, step, tangent in zip(
                    self.groups, point.q, direction, tangents, strict=True
                )
            ]
            if not any(push.any() for push in pushed):
                break
            tangents = [t.holding(push) for t, push in zip(tangents, pushed, strict=True)]
            direction = self._direction(point, tangents)
        return tangents, direction

    @np.errstate(over="ignore", invalid="ignore")
    def _direction(self, point: _Point, tangents: list[Tangent]) -> list[Array]:
        """A Newton step in the tangent spaces that ascends, by group, (count, k, n).

        Curvature that is beyond all numbers is that of a step along the gradient, see `_ascent`.
        """
        count, h = len(point.value), self.options.difference
        changes, blocks = [], []
        for j, (group, tangent) in enumerate(zip(self.groups, tangents, strict=True)):
            k, (d, n) = len(group.columns), tangent.basis.shape[1:]
            basis = tangent.basis.reshape(count, k, d, n)
            displaced = point.q[j][:, :, None] + h * basis
            terms, J, slope = group.local(displaced, point.weights)
            J = J.reshape(count * k, d, group.kernels.m, n)
            bend = slope.reshape(count * k, d, n) - tangent.slope[:, None]
            bend -= (tangent.forces[:, None, None] @ (J - tangent.J[:, None]))[:, :, 0]
            curvature = bend @ tangent.basis.transpose(0, 2, 1) / h
            blocks += list(curvature.reshape(count, k, d, d).swapaxes(0, 1))
            change = terms.reshape(count, k, d, point.sums.shape[1]) - point.terms[j][:, :, None]
            changes.append(change.reshape(count, k * d, point.sums.shape[1]) / h)
        change = np.concatenate(changes, axis=1)
        free = change.shape[1]
        if free == 0:
            return [np.zeros_like(q) for q in point.q]
        shifted = point.sums[:, None] + h * change
        weights = self.score.slope(shifted.reshape(count * free, -1), self.given)[:, 1:]
        bent = weights.reshape(count, free, -1) - point.weights[:, None]
        H = bent @ change.transpose(0, 2, 1) / h
        first = 0
        for block in blocks:
            last = first + block.shape[1]
            H[:, first:last, first:last] += block
            first = last
        gradient = np.concatenate(
            [
                (t.basis @ t.slope[:, :, None]).reshape(count, t.basis.shape[1] * len(c.columns))
                for c, t in zip(self.groups, tangents, strict=True)
            ],
            axis=1,
        )
        step = _ascent(H, gradient, self.options.flattest)
        direction, first = [], 0
        for group, tangent in zip(self.groups, tangents, strict=True):
            k, (d, n) = len(group.columns), tangent.basis.shape[1:]
            part = step[:, first : first + k * d].reshape(count * k, 1, d)
            direction.append((part @ tangent.basis).reshape(count, k, n))
            first += k * d
        return direction

    def _advance(
        self, point: _Point, tangents: list[Tangent], direction: list[Array]
    ) -> tuple[_Point, Mask]:
        """Go along the direction as far as limits allow and the value grows.

        Returns:
            The new postures, and which of them moved.
        """
        count, longest = len(point.value), self.options.longest
        reach, gain = np.ones(count), np.zeros(count)
        held = []
        for j, (group, step) in enumerate(zip(self.groups, direction, strict=True)):
            size = np.abs(step)
            reach = np.minimum(reach, longest / np.maximum(size.max(axis=(1, 2)), longest))
            room = np.where(step > 0, group.upper - point.q[j], point.q[j] - group.lower)
            part = np.full_like(step, np.inf)
            np.divide(np.maximum(room, 0.0), size, out=part, where=size > 1e-200)
            reach = np.minimum(reach, part.min(axis=(1, 2)))
            gain += (tangents[j].slope.reshape(step.shape) * step).sum(axis=(1, 2))
            held.append(tangents[j].held.reshape(step.shape))
        noise = self.options.noise * (1 + np.abs(point.value))
        closed, ahead = self._retracted(point.q, direction, reach, held)
        moved = closed & (ahead.value >= point.value + 1e-4 * reach * gain - noise)
        trying = (~moved).nonzero()[0]
        for _ in range(self.options.halvings):
            if len(trying) == 0:
                break
            reach[trying] /= 2
            closed, trial = self._retracted(
                [q[trying] for q in point.q], [step[trying] for step in direction], reach[trying],
                [each[trying] for each in held],
            )  # fmt: skip
            required = (point.value + 1e-4 * reach * gain - noise)[trying]
            good = closed & (trial.value >= required)
            ahead.put(trying[good], trial, good)
            moved[trying[good]] = True
            trying = trying[~good]
        return ahead, moved

    def _retracted(
        self, q: list[Array], direction: list[Array], reach: Array, held: list[Mask]
    ) -> tuple[Mask, _Point]:
        """Postures after a step, closed again, with held joints where they are."""
        ends, stops, near = [], [], self.options.at_limit
        closed = np.ones(len(reach), dtype=bool)
        for j, group in enumerate(self.groups):
            origin, stop = q[j], held[j]
            shape, n = origin.shape, origin.shape[2]
            guess = origin + reach[:, None, None] * direction[j]
            low, high = guess < group.lower + near, guess > group.upper - near
            if low.any() or high.any():
                guess = np.where(low, group.lower, np.where(high, group.upper, guess))
                # What a step of full reach brings to its limit stays there.
                stop = stop | ((low | high) & ~group.stopped(origin))
            lower, upper, count = group.lower, group.upper, len(reach)
            if stop.any():
                lower, upper = (
                    np.where(stop, guess, limit).reshape(-1, n) for limit in (lower, upper)
                )
            else:
                lower, upper = _each(lower, count), _each(upper, count)
            end, gap = project(
                group.kernels, guess.reshape(-1, n), _each(group.goals, count), lower, upper,
                steps=12, closed=self.options.closed,
            )  # fmt: skip
            closed &= (gap < CLOSED).reshape(shape[:2]).all(axis=1)
            ends.append(end.reshape(shape))
            stops.append(stop | group.stopped(ends[-1]))
        return closed, self._point(ends, stops)


def _each(values: Array, count: int) -> Array:
    """Values of the arms, (k, n), so many times one after the other, (count · k, n)."""
    if count == 1:
        return values
    # A tenth of the time that np.tile takes.
    repeated = np.empty((count, *values.shape))
    repeated[:] = values
    return repeated.reshape(-1, values.shape[1])


def _ascent(H: Array, gradient: Array, flattest: float) -> Array:
    """Newton's step for a maximum, with the Hessian's eigenvalues made negative, (count, D)."""
    H = (H + H.transpose(0, 2, 1)) / 2
    sound = np.isfinite(H).all(axis=(1, 2))
    if not sound.all():
        H[~sound] = -np.eye(H.shape[1])
    values, vectors = np.linalg.eigh(H)
    size = np.abs(values)
    size = np.maximum(size, flattest * np.maximum(size.max(axis=1, keepdims=True), 1.0))
    along = (vectors.transpose(0, 2, 1) @ gradient[:, :, None])[:, :, 0]
    return np.asarray((vectors @ (along / size)[:, :, None])[:, :, 0])
