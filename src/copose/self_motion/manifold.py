"""What an arm that holds an object moves on: its closure and its limits, one step at a time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array, Indices, Mask
from copose.self_motion.kernels import ArmKernels

_CORRECTIONS = 5


@dataclass(frozen=True, eq=False)
class ClosureManifold:
    """What arms of one model move on.

    Attributes:
        kernels: of the model.
        goals: of the tips, see `Placement`, (k, 7).
        lower: joint limits, (k, n); ``upper`` alike.
        unlimited: joints that are the same after a turn, (k, n).
    """

    kernels: ArmKernels
    goals: Array
    lower: Array
    upper: Array
    unlimited: Mask

    @property
    def spare(self) -> int:
        """Degrees of freedom of each arm's self-motion."""
        return self.kernels.n - self.kernels.m

    def taken(self, arms: Indices) -> ClosureManifold:
        """Those of some arms, one or more times each."""
        return ClosureManifold(
            self.kernels, self.goals[arms], self.lower[arms], self.upper[arms], self.unlimited[arms]
        )

    def many(self, count: int) -> ClosureManifold:
        """Those of one arm, so many times."""
        return self.taken(np.zeros(count, dtype=np.intp))

    def wrapped(self, offset: Array) -> Array:
        """Differences, (k, n), without the whole turns of unlimited joints."""
        if not self.unlimited.any():
            return offset
        turns = np.round(offset / (2 * np.pi))
        return np.where(self.unlimited, offset - 2 * np.pi * turns, offset)

    def excess(self, q: Array, known: Array) -> Array:
        """How far each joint is beyond its limits, (k, n), at q; what a known posture has of a
        margin, which it may only leave, is none.
        """
        lower, upper = np.minimum(self.lower, known), np.maximum(self.upper, known)
        return np.asarray(np.maximum(lower - q, q - upper))

    def step(
        self, q: Array, tangent: Array, length: Array, bend: Array, tolerance: float
    ) -> tuple[Array, Array, Mask]:
        """Points of the curves in the planes across their tangents.

        Args:
            q: on the curves, (k, n).
            tangent: there, (k, n).
            length: of the step along it, (k,).
            bend: derivative of the tangent, about, (k, n).
            tolerance: the residual that need not be corrected.

        Returns:
            The points, (k, n), [J; tᵀ] there, (k, n, n), and where that came to an end, (k,).
        """
        m, n = self.kernels.m, self.kernels.n
        far = length[:, None]
        x = q + far * tangent + far**2 / 2 * bend
        # What the bend adds along the tangent is taken away: the plane is where it is said to be.
        x -= ((x - q) * tangent).sum(axis=1, keepdims=True) * tangent - far * tangent
        A, right = np.empty((len(q), n, n)), np.zeros((len(q), n, 1))
        A[:, m:] = tangent[:, None]
        for k in range(_CORRECTIONS):
            residual, A[:, :m] = self.kernels.residual(x, self.goals)
            closed = np.abs(residual).max(axis=1) < tolerance
            if k + 1 == _CORRECTIONS or closed.all():
                break
            right[:, :m, 0] = -residual
            x = x + solved(A, right)
        return x, A, closed

    def tangents(self, A: Array, heading: Array) -> tuple[Array, Array, Array]:
        """Of [J; headingᵀ]: unit tangents t, their cosines with the heading, and det [J; tᵀ]."""
        right = np.zeros((len(A), A.shape[1], 1))
        right[:, -1] = 1.0
        x = solved(A, right)
        size = np.sqrt((x**2).sum(axis=1))
        return x / size[:, None], 1 / size, np.linalg.det(A) * size


def solved(A: Array, right: Array) -> Array:
    """A⁻¹ right, (k, n); of the least norm where there is none."""
    try:
        return np.asarray(np.linalg.solve(A, right)[:, :, 0])
    except np.linalg.LinAlgError:
        return np.asarray((np.linalg.pinv(A) @ right)[:, :, 0])
