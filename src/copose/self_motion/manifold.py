"""The manifold of closed postures of an arm: its closure and limits, a step, and tangents.

The predictor–corrector step of numerical continuation: along the tangent and its derivative, then
by Newton steps onto the manifold in the plane across the tangent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array, Indices, Mask
from copose.self_motion.kernels import ArmKernels


@dataclass(frozen=True, eq=False)
class ClosureManifold:
    """Closed postures within limits of k arms of one model."""

    kernels: ArmKernels  # of the model
    goals: Array  # of the tips, see `KernelInputs`, (k, 7)
    lower: Array  # joint limits, (k, n); ``upper`` alike
    upper: Array
    unlimited: Mask  # joints that are the same after a turn, (k, n)

    @property
    def spare(self) -> int:
        """Degrees of freedom of each arm's self-motion."""
        return self.kernels.n - self.kernels.m

    def taken(self, arms: Indices) -> ClosureManifold:
        """The manifolds of some of the arms, one or more times each."""
        return ClosureManifold(
            self.kernels, self.goals[arms], self.lower[arms], self.upper[arms], self.unlimited[arms]
        )

    def many(self, count: int) -> ClosureManifold:
        """The manifold of the first arm, so many times."""
        return self.taken(np.zeros(count, dtype=np.intp))

    def widened(self, known: Array) -> ClosureManifold:
        """The manifolds with limits that known postures, (k, n), are within."""
        lower, upper = np.minimum(self.lower, known), np.maximum(self.upper, known)
        return ClosureManifold(self.kernels, self.goals, lower, upper, self.unlimited)

    def wrapped(self, offset: Array) -> Array:
        """Differences of postures, (k, n), without the whole turns of unlimited joints."""
        turn = 2 * np.pi
        return offset - np.where(self.unlimited, turn * np.rint(offset / turn), 0.0)

    def excess(self, q: Array, known: Array) -> Array:
        """Distance of each joint beyond its limits, (k, n), negative within them.

        Args:
            q: postures, (k, n).
            known: postures that may be beyond limits, (k, n): so far the limits are wider.
        """
        limits = self.widened(known)
        return np.asarray(np.maximum(limits.lower - q, q - limits.upper))

    def embedded(self, q: Array) -> Array:
        """Postures, (k, n), as points, (k, 2n), that turns of unlimited joints do not move."""
        n, turning = q.shape[1], self.unlimited
        places = np.zeros((len(q), 2 * n))
        places[:, :n] = np.where(turning, np.cos(q), q)
        np.sin(q, out=places[:, n:], where=turning)
        return places

    def step(
        self, q: Array, tangent: Array, length: Array, bend: Array, tolerance: float
    ) -> CurveStep:
        """A step along curves: predicted by tangents, corrected in the planes across them.

        Args:
            q: on the curves, (k, n), with one degree of freedom to spare.
            tangent: there, (k, n).
            length: of the step along it, (k,).
            bend: about the derivative of the tangent by the arc length, (k, n).
            tolerance: the norm of the residual of closed postures.

        Raises:
            ValueError: arms have not one degree of freedom to spare.
        """
        n, correcting = self.kernels.n, self.kernels.correcting
        if correcting is None:
            raise ValueError("there is no curve without one degree of freedom to spare")
        far = length[:, None]
        # The part of the bend along the tangent is taken away: the plane stays at the length.
        across = bend - (bend * tangent).sum(axis=1, keepdims=True) * tangent
        rows = np.empty((len(q), 2 * n))
        rows[:, :n], rows[:, n:] = q + far * tangent + far**2 / 2 * across, tangent
        ends = correcting(rows, self.goals)
        closed = ends[:, 2 * n + 1] < tolerance
        if not closed.all():
            rows[:, :n] = ends[:, :n]
            again = ~closed
            ends[again] = correcting(rows[again], self.goals[again])
            closed = ends[:, 2 * n + 1] < tolerance
        return CurveStep(
            ends[:, :n], ends[:, n : 2 * n], ends[:, 2 * n], ends[:, 2 * n + 2], closed
        )


@dataclass(frozen=True, eq=False)
class CurveStep:
    """Ends of steps along curves of closed postures."""

    q: Array  # postures, (k, n)
    tangent: Array  # unit tangents there, (k, n)
    cosine: Array  # of the angles between the tangents at both ends, (k,)
    orientation: Array  # det [J; tᵀ], t the tangent, (k,): zero where curves meet
    closed: Mask  # which are closed, (k,)

    def taken(self, rows: Mask) -> CurveStep:
        """Some of the steps."""
        return CurveStep(
            self.q[rows], self.tangent[rows], self.cosine[rows], self.orientation[rows],
            self.closed[rows],
        )  # fmt: skip
