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
        if not self.unlimited.any():
            return offset
        turns = np.round(offset / (2 * np.pi))
        return np.where(self.unlimited, offset - 2 * np.pi * turns, offset)

    def excess(self, q: Array, known: Array) -> Array:
        """Distance of each joint beyond its limits, (k, n), negative within them.

        Args:
            q: postures, (k, n).
            known: postures that may be beyond limits, (k, n): so far the limits are wider.
        """
        limits = self.widened(known)
        return np.asarray(np.maximum(limits.lower - q, q - limits.upper))

    def step(
        self,
        q: Array,
        tangent: Array,
        length: Array,
        bend: Array,
        tolerance: float,
        corrections: int = 5,
    ) -> tuple[Array, Array, Mask]:
        """A step along curves: predicted by tangents, corrected in the planes across them.

        Args:
            q: on the curves, (k, n).
            tangent: there, (k, n).
            length: of the step along it, (k,).
            bend: about the derivative of the tangent by the arc length, (k, n).
            tolerance: the residual that needs no correction.
            corrections: Newton steps, at most, and one evaluation.

        Returns:
            The points, (k, n), [J; tᵀ] there, (k, n, n), and which are closed, (k,).
        """
        m, n = self.kernels.m, self.kernels.n
        far = length[:, None]
        x = q + far * tangent + far**2 / 2 * bend
        # The part of the bend along the tangent is taken away: the plane stays at the length.
        x -= ((x - q) * tangent).sum(axis=1, keepdims=True) * tangent - far * tangent
        A, right = np.empty((len(q), n, n)), np.zeros((len(q), n, 1))
        A[:, m:] = tangent[:, None]
        for k in range(corrections):
            residual, A[:, :m] = self.kernels.residual(x, self.goals)
            closed = np.abs(residual).max(axis=1) < tolerance
            if k + 1 == corrections or closed.all():
                break
            right[:, :m, 0] = -residual
            x = x + solved(A, right)
        return x, A, closed

    def tangents(self, A: Array, heading: Array) -> tuple[Array, Array, Array]:
        """Unit tangents t, their cosines with headings, and det [J; tᵀ], of [J; headingᵀ]."""
        right = np.zeros((len(A), A.shape[1], 1))
        right[:, -1] = 1.0
        x = solved(A, right)
        size = np.sqrt((x**2).sum(axis=1))
        return x / size[:, None], 1 / size, np.linalg.det(A) * size


def null_vectors(J: Array) -> Array:
    """Unit vectors t with J t = 0, (k, n), of matrices with one column more than rows."""
    return np.asarray(np.linalg.qr(J.swapaxes(1, 2), mode="complete")[0][:, :, -1])


def solved(A: Array, right: Array) -> Array:
    """A⁻¹ right, (k, n); of the least norm where there is none."""
    try:
        return np.asarray(np.linalg.solve(A, right)[:, :, 0])
    except np.linalg.LinAlgError:
        return np.asarray((np.linalg.pinv(A) @ right)[:, :, 0])
