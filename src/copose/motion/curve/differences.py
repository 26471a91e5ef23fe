"""Rates of motions sampled at uniform knots: finite differences and cubic splines."""

from __future__ import annotations

import numpy as np

from copose.poses import Array


def slopes(q: Array, step: float) -> Array:
    """Central differences; zero at both ends, where nothing moves, (n, N)."""
    rates = np.zeros_like(q)
    rates[1:-1] = (q[2:] - q[:-2]) / (2 * step)
    return rates


def bends(q: Array, step: float) -> Array:
    """Second differences; at the ends, where nothing moves, of knots mirrored there, (n, N)."""
    accelerations = np.empty_like(q)
    accelerations[1:-1] = (q[2:] - 2 * q[1:-1] + q[:-2]) / step**2
    accelerations[0], accelerations[-1] = 2 * (q[1] - q[0]) / step**2, 2 * (q[-2] - q[-1]) / step**2
    return accelerations


def spline_slopes(q: Array, step: float) -> Array:
    """Slopes, (n, N), of the cubic spline through the knots that is at rest at both ends.

    v[k−1] + 4 v[k] + v[k+1] = 3 (q[k+1] − q[k−1]) / step.
    """
    rates = np.zeros_like(q)
    inner = len(q) - 2
    rates[1:-1] = tridiagonal(np.full(inner, 4.0), np.ones(inner), 6 * slopes(q, step)[1:-1])
    return rates


def tridiagonal(diagonal: Array, off_diagonal: Array, right: Array) -> Array:
    """The solution of a symmetric tridiagonal system, (n,) or (n, N), by Thomas' elimination.

    Written out because the library's solvers take longer to load than a motion to plan.

    Args:
        diagonal: (n,).
        off_diagonal: the entry of each row right of its diagonal, (n,); the last does not count.
        right: right-hand side, (n,) or (n, N).
    """
    pivots, solution = diagonal.copy(), right.copy()
    for k in range(1, len(pivots)):
        factor = off_diagonal[k - 1] / pivots[k - 1]
        pivots[k] -= factor * off_diagonal[k - 1]
        solution[k] -= factor * solution[k - 1]
    for k in range(len(pivots) - 1, -1, -1):
        if k + 1 < len(pivots):
            solution[k] -= off_diagonal[k] * solution[k + 1]
        solution[k] /= pivots[k]
    return solution
