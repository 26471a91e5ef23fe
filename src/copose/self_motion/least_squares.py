"""The nearest that an arm comes to its grasp: least squares within joint limits, many at once."""

from __future__ import annotations

import numpy as np

from copose.poses import Array
from copose.self_motion.kernels import ArmKernels

_STEPS = 60
# Of the differences that second derivatives are taken from, rad or m.
_DIFFERENCE = 1e-6
_LONGEST_STEP = 0.7
# Of the largest curvature: of the first step what is added to all; the least that one counts with.
_DAMPING, _FLAT = 1e-3, 1e-12
_EASED, _DAMPED, _STUCK = 0.1, 8.0, 1e8
# What a step promises of ½|r|², relative and in squares of m or rad, where it is the last.
_GAIN, _NOTHING = 1e-11, 1e-27


def nearest(
    kernels: ArmKernels,
    q: Array,
    goal: Array,
    lower: Array,
    upper: Array,
    *,
    weights: Array | float = 1.0,
) -> tuple[Array, Array]:
    """Damped Newton steps to a local minimum of |weights · closure(q)| over lower ≤ q ≤ upper.

    The chain closed, the minimum is zero; else it is a nearest miss. Second derivatives count, for
    far from closing Gauss–Newton steps crawl; directions of negative curvature are followed down.

    Args:
        kernels: of the arm.
        q: postures to start from, (count, n).
        goal: of the tip, see `Placement`, (7,).
        lower: joint limits, −inf where there is none, (n,).
        upper: alike.
        weights: of the closure's rows, (m,).

    Returns:
        Postures (count, n) within the limits, and |weights · closure| there, (count,).
    """
    n = kernels.n
    factor = np.broadcast_to(weights, (kernels.m,))

    def residual(x: Array) -> tuple[Array, Array]:
        r, J = kernels.residual(x, goal)
        return r * factor, J * factor[:, None]

    q = np.clip(q, lower, upper)
    r, J = residual(q)
    half_square = (r * r).sum(axis=1) / 2
    damping = np.full(len(q), _DAMPING)
    rows = np.arange(len(q))
    for _ in range(_STEPS):
        x, r_x, J_x = q[rows], r[rows], J[rows]
        slope = np.einsum("kmi,km->ki", J_x, r_x)
        stopped = ((x <= lower) & (slope > 0)) | ((x >= upper) & (slope < 0))
        slope[stopped] = 0.0
        beside = (x[:, None] + _DIFFERENCE * np.eye(n)).reshape(-1, n)
        J_beside = residual(beside)[1].reshape(len(x), n, kernels.m, n)
        bend = np.einsum("kimj,km->kij", (J_beside - J_x[:, None]) / _DIFFERENCE, r_x)
        hessian = J_x.swapaxes(1, 2) @ J_x + (bend + bend.swapaxes(1, 2)) / 2
        hessian[stopped[:, :, None] | stopped[:, None]] = 0.0
        curvature, along = np.linalg.eigh(hessian)
        curvature = np.abs(curvature)
        most = curvature.max(axis=1, keepdims=True)
        curvature = np.maximum(curvature, _FLAT * most + 1e-300) + damping[rows, None] * most
        parts = np.einsum("kij,ki->kj", along, slope)
        step = -np.einsum("kij,kj->ki", along, parts / curvature)
        gain = (parts**2 / curvature).sum(axis=1) / 2
        step *= np.minimum(1.0, _LONGEST_STEP / np.abs(step).max(axis=1).clip(1e-300))[:, None]
        there = np.clip(x + step, lower, upper)
        r_there, J_there = residual(there)
        ends = (r_there * r_there).sum(axis=1) / 2
        better = ends <= half_square[rows]
        damping[rows] = np.where(better, _EASED * damping[rows], _DAMPED * damping[rows] + 1e-9)
        moved = rows[better]
        q[moved], r[moved], J[moved] = there[better], r_there[better], J_there[better]
        half_square[moved] = ends[better]
        rows = rows[(gain > _GAIN * half_square[rows] + _NOTHING) & (damping[rows] < _STUCK)]
        if not len(rows):
            break
    return q, np.sqrt(2 * half_square)
