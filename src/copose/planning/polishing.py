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

import numpy as np

from copose.planning.arm_kernels import ArmKernels, Placement
from copose.planning.closing import CLOSED, project
from copose.planning.screening import Score
from copose.poses import Array, Indices, Mask

# IPOPT's: optimality, scaled as its manual says, and closure.
TOLERANCE = 1e-9
_SCALE = 100.0
_ITERATIONS = 60
_HALVINGS = 12
# Of a joint in one step, rad or m.
_LONGEST = 0.3
_DIFFERENCE = 1e-6
_RANK = 1e-9
_FLATTEST = 1e-8
_ROUNDING = 1e-13


@dataclass(frozen=True, eq=False)
class Polished:
    """Where starts ended.

    Attributes:
        q: joints of all arms, (count, N).
        value: of the score, (count,).
        error: IPOPT's measure of optimality there, see `Polisher`, (count,).
    """

    q: Array
    value: Array
    error: Array

    @property
    def converged(self) -> Mask:
        """Whether IPOPT's tolerance is met, (count,)."""
        return np.asarray(self.error <= TOLERANCE)


@dataclass(frozen=True, eq=False)
class _Point:
    """Postures with everything that the next step takes.

    Arrays begin with (count,); lists have an entry for each arm.

    Attributes:
        q: by arm, (count, n).
        terms: by arm, (count, s).
        value: (count,).
        weights: derivatives of the value by the sums of the terms, (count, s).
    """

    q: list[Array]
    terms: list[Array]
    value: Array
    weights: Array


@dataclass(frozen=True, eq=False)
class Polisher:
    """Maximises a score over the postures of a cell.

    Attributes:
        arms: kernels by arm.
        score: of the sums of the arms' terms.
        placement: of the object.
        given: what the score's kernels take beside the sums.
        lower: joint limits by arm; infinite where a joint can turn all the way.
        upper: alike.
    """

    arms: Sequence[ArmKernels]
    score: Score
    placement: Placement
    given: Array
    lower: Sequence[Array]
    upper: Sequence[Array]

    def polish(self, q: Array) -> Polished:
        """Climb from closed postures, (count, N), to local maxima."""
        edges = np.cumsum([arm.n for arm in self.arms])[:-1]
        ends, values = q.copy(), np.full(len(q), -np.inf)
        errors = np.full(len(q), np.inf)
        rows = np.arange(len(q))
        point = self._point(np.split(q, edges, axis=1))
        sound = np.isfinite(point.value)
        rows, point = rows[sound], _taken(point, sound)
        held = [self._stopped(i, mine) for i, mine in enumerate(point.q)]
        for _ in range(_ITERATIONS):
            if len(rows) == 0:
                break
            slopes = [self._slope(i, q, point.weights) for i, q in enumerate(point.q)]
            planes = [self._plane(i, point.q[i], slopes[i], held[i]) for i in range(len(self.arms))]
            held = [plane.held for plane in planes]
            error = self._error(planes)
            ends[rows], values[rows], errors[rows] = np.hstack(point.q), point.value, error
            going = error > TOLERANCE
            rows, point = rows[going], _taken(point, going)
            planes = [plane.taken(going) for plane in planes]
            held = [mine[going] for mine in held]
            if len(rows) == 0:
                break
            direction = self._direction(point, planes)
            point, moved, held = self._advance(point, planes, direction, held)
            rows, point = rows[moved], _taken(point, moved)
            held = [mine[moved] for mine in held]
        return Polished(ends, values, errors)

    def _point(self, q: list[Array]) -> _Point:
        terms = [
            arm.terms(mine, tie)
            for arm, mine, tie in zip(self.arms, q, self.placement.ties, strict=True)
        ]
        sums = np.asarray(sum(terms))
        value = self.score.value(sums, self.given)[:, 0]
        return _Point(q, terms, value, self.score.slope(sums, self.given))

    def _slope(self, i: int, q: Array, weights: Array) -> Array:
        """Derivatives of the value by the joints of arm i, (count, n)."""
        return self.arms[i].slope(np.hstack([q, weights]), self.placement.ties[i])

    def _stopped(self, i: int, q: Array) -> Mask:
        return np.asarray((q <= self.lower[i]) | (q >= self.upper[i]))

    def _plane(self, i: int, q: Array, slope: Array, held: Mask) -> _Plane:
        """The tangent space at q; held joints that would rather leave their limits are let go."""
        _, J = self.arms[i].residual(q, self.placement.goals[i])
        outward = (q >= self.upper[i]).astype(float) - (q <= self.lower[i])
        plane = _Plane.of(J, slope, held & (outward != 0), outward)
        for _ in range(q.shape[1]):
            # The value grows inwards: the joint that gains most is free again.
            pull = np.where(plane.held, -outward * plane.multipliers, 0.0)
            worst = pull.argmax(axis=1)
            wrong = pull[np.arange(len(q)), worst] > TOLERANCE
            if not wrong.any():
                break
            held = plane.held.copy()
            held[np.flatnonzero(wrong), worst[wrong]] = False
            plane = _Plane.of(J, slope, held, outward)
        return plane

    def _error(self, planes: list[_Plane]) -> Array:
        """IPOPT's scaled dual infeasibility, (count,).

        The largest entry of ∇f + Jᵀλ − z with least-squares multipliers, over
        max(100, mean |λ|, |z|)/100 (A. Wächter, L. T. Biegler, 2006, eq. 5).
        """
        largest = np.max([np.abs(plane.rest).max(axis=1) for plane in planes], axis=0)
        total = sum(plane.multiplier_sum for plane in planes)
        count = sum(arm.m + arm.n for arm in self.arms)
        return np.asarray(largest / np.maximum(1.0, total / count / _SCALE))

    def _direction(self, point: _Point, planes: list[_Plane]) -> list[Array]:
        """A Newton step in the tangent spaces that ascends, by arm, (count, n)."""
        count = len(point.value)
        changes, curvatures, weights = [], [], []
        sums = np.asarray(sum(point.terms))
        for i, (arm, plane) in enumerate(zip(self.arms, planes, strict=True)):
            basis = plane.basis
            d, n = basis.shape[1:]
            if d == 0:
                continue
            beside = (point.q[i][:, None] + _DIFFERENCE * basis).reshape(-1, n)
            repeated = np.repeat(point.weights, d, axis=0)
            slope = self._slope(i, beside, repeated).reshape(count, d, n)
            _, J = arm.residual(beside, self.placement.goals[i])
            J = J.reshape(count, d, arm.m, n)
            bend = (
                slope
                - plane.slope[:, None]
                - np.einsum("cdmn,cm->cdn", J - plane.J[:, None], plane.forces)
            )
            curvatures.append(bend @ basis.transpose(0, 2, 1) / _DIFFERENCE)
            terms = arm.terms(beside, self.placement.ties[i]).reshape(count, d, -1)
            change = (terms - point.terms[i][:, None]) / _DIFFERENCE
            changes.append(change)
            shifted = (sums[:, None] + _DIFFERENCE * change).reshape(count * d, -1)
            weights.append(self.score.slope(shifted, self.given).reshape(count, d, -1))
        if not changes:
            return [np.zeros_like(q) for q in point.q]
        change = np.concatenate(changes, axis=1)
        weight = (np.concatenate(weights, axis=1) - point.weights[:, None]) / _DIFFERENCE
        H = weight @ change.transpose(0, 2, 1)
        k = 0
        for block in curvatures:
            d = block.shape[1]
            H[:, k : k + d, k : k + d] += block
            k += d
        gradient = np.concatenate(
            [(plane.basis @ plane.slope[:, :, None])[:, :, 0] for plane in planes], axis=1
        )
        step = _ascent(H, gradient)
        parts = np.split(step, np.cumsum([plane.basis.shape[1] for plane in planes])[:-1], axis=1)
        return [
            (part[:, None] @ plane.basis)[:, 0] for part, plane in zip(parts, planes, strict=True)
        ]

    def _advance(
        self, point: _Point, planes: list[_Plane], direction: list[Array], held: list[Mask]
    ) -> tuple[_Point, Mask, list[Mask]]:
        """Go along the direction as far as limits allow and the value grows.

        Returns:
            The new postures, which of them moved, and what is held at them.
        """
        count = len(point.value)
        reach = np.ones(count)
        for step in direction:
            longest = np.abs(step).max(axis=1)
            reach = np.minimum(reach, _LONGEST / np.maximum(longest, _LONGEST))
        for i, step in enumerate(direction):
            room = np.where(step > 0, self.upper[i] - point.q[i], point.q[i] - self.lower[i])
            with np.errstate(divide="ignore", invalid="ignore"):
                part = np.where(step != 0, np.maximum(room, 0.0) / np.abs(step), np.inf)
            reach = np.minimum(reach, part.min(axis=1))
        gain = np.asarray(
            sum(
                (plane.slope * step).sum(axis=1)
                for plane, step in zip(planes, direction, strict=True)
            )
        )
        best = point
        moved = np.zeros(count, dtype=bool)
        trying = np.arange(count)
        new_held = [mine.copy() for mine in held]
        for _ in range(_HALVINGS):
            tried = self._retracted(point, direction, reach, held, trying)
            if tried is not None:
                closed, trial, stops = tried
                wanted = 1e-4 * reach[trying] * gain[trying]
                noise = _ROUNDING * (1 + np.abs(point.value[trying]))
                good = closed & (trial.value >= point.value[trying] + wanted - noise)
                best = _placed(best, trial, trying[good], good)
                for mine, stop in zip(new_held, stops, strict=True):
                    mine[trying[good]] = stop[good]
                moved[trying[good]] = True
                trying = trying[~good]
            if len(trying) == 0:
                break
            reach[trying] /= 2
        return best, moved, new_held

    def _retracted(
        self, point: _Point, direction: list[Array], reach: Array, held: list[Mask], rows: Indices
    ) -> tuple[Mask, _Point, list[Mask]] | None:
        """Postures after a step, closed again, with held joints where they are."""
        ends, stops = [], []
        closed = np.ones(len(rows), dtype=bool)
        for i, arm in enumerate(self.arms):
            there = point.q[i][rows]
            guess = np.clip(
                there + reach[rows, None] * direction[i][rows], self.lower[i], self.upper[i]
            )
            # What a step of full reach brings to its limit stays there.
            stop = held[i][rows] | (self._stopped(i, guess) & ~self._stopped(i, there))
            lower = np.where(stop, guess, self.lower[i])
            upper = np.where(stop, guess, self.upper[i])
            end, gap = project(arm, guess, self.placement.goals[i], lower, upper, steps=12,
                               closed=1e-12)  # fmt: skip
            closed &= gap < CLOSED
            ends.append(end)
            stops.append(stop | self._stopped(i, end))
        return closed, self._point(ends), stops


@dataclass(frozen=True, eq=False)
class _Plane:
    """The tangent space of one arm's self-motion and the multipliers there.

    Attributes:
        J: derivative of the closure, (count, m, n).
        slope: of the value, (count, n).
        held: joints that a limit stops, (count, n).
        basis: orthonormal rows, zero where there are fewer, (count, d, n).
        forces: multipliers of the closure, (count, m).
        multipliers: what is left of the slope at held joints, (count, n).
        rest: what is left of it at the others, (count, n).
    """

    J: Array
    slope: Array
    held: Mask
    basis: Array
    forces: Array
    multipliers: Array
    rest: Array

    @classmethod
    def of(cls, J: Array, slope: Array, held: Mask, outward: Array) -> _Plane:
        """From the singular values of J with the held joints taken out."""
        U, s, V = np.linalg.svd(np.where(held[:, None], 0.0, J))
        least = _RANK * s[:, :1]
        full = s > least
        inverse = np.where(full, 1 / np.where(full, s, 1.0), 0.0)
        k = s.shape[1]
        along = (V[:, :k] @ slope[:, :, None])[:, :, 0] * inverse
        forces = (U[:, :, :k] @ along[:, :, None])[:, :, 0]
        left = slope - (forces[:, None] @ J)[:, 0]
        multipliers = np.where(held, left, 0.0)
        rest = np.where(held, 0.0, left)
        basis = _null_space(V[:, k:], held) if held.any() else V[:, k:]
        return cls(J, slope, held, basis, forces, multipliers, rest)

    @property
    def multiplier_sum(self) -> Array:
        return np.asarray(np.abs(self.forces).sum(axis=1) + np.abs(self.multipliers).sum(axis=1))

    def taken(self, rows: Mask) -> _Plane:
        return _Plane(**{name: value[rows] for name, value in vars(self).items()})


def _null_space(null: Array, held: Mask) -> Array:
    """Of the null space of a matrix with held columns taken out, the part that moves no held joint.

    Args:
        null: orthonormal rows, (count, d, n), that span it together with the held directions.
        held: (count, n).
    """
    if null.shape[1] == 0:
        return null
    _, sizes, rows = np.linalg.svd(np.where(held[:, None], 0.0, null), full_matrices=False)
    return np.where((sizes > 0.5)[:, :, None], rows, 0.0)


def _ascent(H: Array, gradient: Array) -> Array:
    """Newton's step for a maximum, with the Hessian's eigenvalues made negative, (count, D)."""
    H = (H + H.transpose(0, 2, 1)) / 2
    sound = np.asarray(np.isfinite(H).all(axis=(1, 2)))
    H[~sound] = -np.eye(H.shape[1])
    values, vectors = np.linalg.eigh(H)
    size = np.abs(values)
    size = np.maximum(size, _FLATTEST * np.maximum(size.max(axis=1, keepdims=True), 1.0))
    along = (vectors.transpose(0, 2, 1) @ gradient[:, :, None])[:, :, 0]
    return np.asarray((vectors @ (along / size)[:, :, None])[:, :, 0])


def _taken(point: _Point, rows: Mask) -> _Point:
    return _Point(
        [q[rows] for q in point.q],
        [terms[rows] for terms in point.terms],
        point.value[rows],
        point.weights[rows],
    )


def _placed(point: _Point, other: _Point, rows: Indices, chosen: Mask) -> _Point:
    """The first with some rows replaced by chosen ones of the other."""

    def put(into: Array, values: Array) -> Array:
        into = into.copy()
        into[rows] = values[chosen]
        return into

    return _Point(
        [put(a, b) for a, b in zip(point.q, other.q, strict=True)],
        [put(a, b) for a, b in zip(point.terms, other.terms, strict=True)],
        put(point.value, other.value),
        put(point.weights, other.weights),
    )
