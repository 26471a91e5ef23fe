"""Closing the chain: joint positions of one arm projected onto its grasp, many at once."""

from __future__ import annotations

import casadi as ca
import numpy as np

from copose.mechanics import System
from copose.poses import Array

CLOSED = 1e-9
_STEPS = 60
_LONGEST_STEP = 0.7


class Projector:
    """Projects postures of arm i onto {q : closure_i(q) = 0, lower ≤ q ≤ upper}.

    With the object held still the arms close independently of one another, and an arm that
    reaches its grasp from 15 % of random postures need not wait for the others' luck.
    """

    def __init__(self, system: System, i: int) -> None:
        """Build the residual of arm i and its derivative."""
        mechanics = system.arms[i]
        residual = system.closure(i)
        self._function = ca.Function(
            "closure",
            [mechanics.q, system.object.parameters],
            [residual, ca.jacobian(residual, mechanics.q)],
        )
        self._m, self._n = residual.shape[0], mechanics.arm.n

    def residuals(self, q: Array, parameters: Array) -> tuple[Array, Array]:
        """Residuals (count, m) and derivatives (count, m, n) of the closure at q (count, n)."""
        values, slopes = self._function(q.T, parameters)
        derivative = np.array(slopes).reshape(self._m, len(q), self._n).transpose(1, 0, 2)
        return np.array(values).reshape(self._m, len(q)).T, derivative

    def project(
        self, q: Array, parameters: Array, lower: Array, upper: Array
    ) -> tuple[Array, Array]:
        """Damped Gauss–Newton steps within the limits.

        Where a step would push a joint through its limit, the others take it without that joint.

        Args:
            q: postures to start from, (count, n).
            parameters: of the object.
            lower: joint limits, (n,).
            upper: alike.

        Returns:
            Postures (count, n) within the limits, and the norms of their residuals (count,).
        """
        q = np.clip(q, lower, upper)
        gaps = np.full(len(q), np.inf)
        active = np.arange(len(q))
        for _ in range(_STEPS):
            residual, slope = self.residuals(q[active], parameters)
            norm = np.linalg.norm(residual, axis=1)
            gaps[active] = norm
            going = norm > 1e-13
            active, residual, slope, norm = (
                active[going], residual[going], slope[going], norm[going],
            )  # fmt: skip
            if len(active) == 0:
                break
            now = q[active]
            step = _damped_step(residual, slope, norm)
            blocked = ((now <= lower) & (step < 0)) | ((now >= upper) & (step > 0))
            if blocked.any():
                held = np.where(blocked[:, None, :], 0.0, slope)
                step = _damped_step(residual, held, norm)
            longest = np.abs(step).max(axis=1, keepdims=True)
            step *= np.minimum(1.0, _LONGEST_STEP / np.maximum(longest, 1e-300))
            q[active] = np.clip(now + step, lower, upper)
        residual, _ = self.residuals(q, parameters)
        return q, np.linalg.norm(residual, axis=1)


def _damped_step(residual: Array, slope: Array, norm: Array) -> Array:
    """−Jᵀ(J Jᵀ + λI)⁻¹ r, λ falling with the residual so that convergence stays quadratic."""
    m = residual.shape[1]
    normal = slope @ slope.transpose(0, 2, 1)
    size = np.trace(normal, axis1=1, axis2=2) / m
    damping = (1e-3 * np.minimum(norm, 1.0) ** 2 + 1e-13) * size + 1e-100
    normal += damping[:, None, None] * np.eye(m)
    solved = np.linalg.solve(normal, residual[:, :, None])
    return np.asarray(-(slope.transpose(0, 2, 1) @ solved)[:, :, 0])
