"""An arm with degrees of freedom to spare, moved by hand while it holds the object."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array
from copose.self_motion.manifold import ClosureManifold
from copose.self_motion.projection import CLOSED, project

# The longest step along a direction, rad (or m), and the part of it that has to be made.
_STEP = 0.05
_MADE = 0.1


@dataclass(frozen=True, eq=False)
class NullMotion:
    """The posture to which a null motion has brought an arm.

    Attributes:
        joints: within limits, closed to 1e-9, (n,).
        basis: orthonormal rows along which it can move from there, (d, n): hand it on to the next
            null motion, and the same number stands for the same direction.
        amount: how far it went, rad (or m); less than asked for where limits or a singular posture
            have stopped it.
    """

    joints: Array
    basis: Array
    amount: float


def null_basis(rails: ClosureManifold, q: Array, nearest: Array | None = None) -> Array:
    """Orthonormal rows that span the directions in which an arm can move and hold the object.

    Any rotation of such rows is one too. Of all the one that is nearest to some given rows is
    taken (the orthogonal Procrustes problem): from posture to posture it does not turn needlessly.

    Args:
        rails: of the arm.
        q: its posture, (n,).
        nearest: rows, (d, n); without them those of the posture in the middle of the joint limits,
            so that without a history the basis is a function of the posture.
    """
    _, J = rails.kernels.residual(q[None], rails.goals)
    null = np.linalg.svd(J[0])[2][rails.kernels.m :]
    if nearest is None:
        limited = np.isfinite(rails.lower[0]) & np.isfinite(rails.upper[0])
        middle = np.zeros(len(q))
        middle[limited] = (rails.lower[0, limited] + rails.upper[0, limited]) / 2
        _, there = rails.kernels.residual(middle[None], rails.goals)
        nearest = np.linalg.svd(there[0])[2][rails.kernels.m :]
    U, _, Vt = np.linalg.svd(nearest @ null.T)
    return np.asarray(U @ Vt @ null)


def null_motion(
    rails: ClosureManifold, q: Array, number: int, amount: float, basis: Array
) -> NullMotion:
    """Move an arm along a direction of its null space, on the manifold of closed postures.

    Each short step is brought back onto the manifold, within limits, and the basis is carried
    along; where a joint meets its limit the others go on as long as they come forward.

    Args:
        rails: of the arm, with its limits.
        q: its closed posture, (n,).
        number: of the direction among the rows of the basis.
        amount: how far, rad (or m); the other way if negative.
        basis: at the posture, (d, n), see `null_basis`.
    """
    way, left, done = np.sign(amount), abs(amount), 0.0
    lower, upper = np.minimum(rails.lower[0], q), np.maximum(rails.upper[0], q)
    while left > 0:
        step = min(left, _STEP)
        t = way * basis[number]
        ends, gaps = project(rails.kernels, (q + step * t)[None], rails.goals[0], lower, upper)
        if not gaps[0] <= CLOSED or (ends[0] - q) @ t < _MADE * step:
            break
        q, left, done = ends[0], left - step, done + step
        basis = null_basis(rails, q, basis)
    return NullMotion(q, basis, float(way * done))
