"""Nonlinear least squares of the closure of one arm within joint limits, many at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array
from copose.self_motion.kernels import ArmKernels


@dataclass(frozen=True)
class LeastSquaresOptions:
    """Damped Newton steps of nonlinear least squares; damping is relative to the curvature."""

    steps: int = 60
    difference: float = 1e-6  # of joints, from which second derivatives are taken, rad or m
    longest: float = 0.7  # change of a joint in a step, rad or m
    damping: float = 1e-3  # of the first step
    flat: float = 1e-12  # ratio of the least curvature that counts to the largest
    eased: float = 0.1  # factor of the damping after a step that does not rise
    damped: float = 8.0  # factor of the damping after one that rises
    stuck: float = 1e8  # damping at which the steps end
    gain: float = 1e-11  # of ½|r|² that a step promises, relative: below it is the last
    least_gain: float = 1e-27  # the same, absolute, in squares of m or rad


def nearest(
    kernels: ArmKernels,
    q: Array,
    goal: Array,
    lower: Array,
    upper: Array,
    *,
    weights: Array | float = 1.0,
    options: LeastSquaresOptions = LeastSquaresOptions(),
) -> tuple[Array, Array]:
    """Local minima of |weights · closure(q)| over lower ≤ q ≤ upper, by damped Newton steps.

    Where the chain closes the minimum is zero; else it is a nearest miss. Second derivatives count,
    for far from closing Gauss–Newton steps crawl; along negative curvature steps go downhill.

    Args:
        kernels: of the arm.
        q: postures to start from, (count, n).
        goal: of the tip, see `KernelInputs`, (7,).
        lower: joint limits, −inf where there is none, (n,).
        upper: alike.
        weights: of the closure's rows, (m,).
        options: of the steps.

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
    damping = np.full(len(q), options.damping)
    rows = np.arange(len(q))
    for _ in range(options.steps):
        x, r_x, J_x = q[rows], r[rows], J[rows]
        slope = np.einsum("kmi,km->ki", J_x, r_x)
        stopped = ((x <= lower) & (slope > 0)) | ((x >= upper) & (slope < 0))
        slope[stopped] = 0.0
        displaced = (x[:, None] + options.difference * np.eye(n)).reshape(-1, n)
        J_displaced = residual(displaced)[1].reshape(len(x), n, kernels.m, n)
        J_slope = (J_displaced - J_x[:, None]) / options.difference
        bend = np.einsum("kimj,km->kij", J_slope, r_x)
        hessian = J_x.swapaxes(1, 2) @ J_x + (bend + bend.swapaxes(1, 2)) / 2
        hessian[stopped[:, :, None] | stopped[:, None]] = 0.0
        curvature, along = np.linalg.eigh(hessian)
        curvature = np.abs(curvature)
        most = curvature.max(axis=1, keepdims=True)
        curvature = np.maximum(curvature, options.flat * most + 1e-300)
        curvature += damping[rows, None] * most
        parts = np.einsum("kij,ki->kj", along, slope)
        step = -np.einsum("kij,kj->ki", along, parts / curvature)
        gain = (parts**2 / curvature).sum(axis=1) / 2
        step *= np.minimum(1.0, options.longest / np.abs(step).max(axis=1).clip(1e-300))[:, None]
        end = np.clip(x + step, lower, upper)
        r_end, J_end = residual(end)
        value = (r_end * r_end).sum(axis=1) / 2
        better = value <= half_square[rows]
        damping[rows] = np.where(
            better, options.eased * damping[rows], options.damped * damping[rows] + 1e-9
        )
        moved = rows[better]
        q[moved], r[moved], J[moved] = end[better], r_end[better], J_end[better]
        half_square[moved] = value[better]
        promising = gain > options.gain * half_square[rows] + options.least_gain
        rows = rows[promising & (damping[rows] < options.stuck)]
        if not len(rows):
            break
    return q, np.sqrt(2 * half_square)
