"""The null space of an arm that holds the object: its basis, and motions along it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array
from copose.self_motion.manifold import ClosureManifold
from copose.self_motion.projection import CLOSED, project


@dataclass(frozen=True)
class NullMotionOptions:
    """Steps of a null motion."""

    longest: float = 0.05  # step along a direction, rad (or m)
    progress: float = 0.1  # along the direction, over the step, at least


@dataclass(frozen=True, eq=False)
class NullMotion:
    """The end of a null motion of an arm.

    Attributes:
        joints: within limits, closed to 1e-9, (n,).
        basis: orthonormal rows along which it can move from there, (d, n): hand it on to the next
            null motion, and the same number stands for the same direction.
        amount: the distance moved, rad (or m); less than asked for where limits or a singular
            posture have stopped it.
    """

    joints: Array
    basis: Array
    amount: float


def null_basis(manifold: ClosureManifold, q: Array, nearest: Array | None = None) -> Array:
    """An orthonormal basis of an arm's null space while it holds the object, as rows, (d, n).

    Of all such bases it is the one nearest to given rows (the orthogonal Procrustes problem), so
    that it does not turn needlessly from posture to posture.

    Args:
        manifold: of the arm.
        q: its posture, (n,).
        nearest: rows, (d, n); without them those of the posture in the middle of the joint limits,
            so that without a history the basis is a function of the posture.
    """
    _, J = manifold.kernels.residual(q[None], manifold.goals)
    null = np.linalg.svd(J[0])[2][manifold.kernels.m :]
    if nearest is None:
        limited = np.isfinite(manifold.lower[0]) & np.isfinite(manifold.upper[0])
        middle = np.zeros(len(q))
        middle[limited] = (manifold.lower[0, limited] + manifold.upper[0, limited]) / 2
        _, J_middle = manifold.kernels.residual(middle[None], manifold.goals)
        nearest = np.linalg.svd(J_middle[0])[2][manifold.kernels.m :]
    U, _, Vt = np.linalg.svd(nearest @ null.T)
    return np.asarray(U @ Vt @ null)


def null_motion(
    manifold: ClosureManifold,
    q: Array,
    number: int,
    amount: float,
    basis: Array,
    options: NullMotionOptions = NullMotionOptions(),
) -> NullMotion:
    """A motion of an arm along a direction of its null space, on the manifold of closed postures.

    Each short step is projected onto the manifold, within limits, and the basis is carried along;
    where a joint meets its limit the others go on as long as they make progress.

    Args:
        manifold: of the arm, with its limits.
        q: its closed posture, (n,).
        number: of the direction among the rows of the basis.
        amount: distance, rad (or m); the other way if negative.
        basis: at the posture, (d, n), see `null_basis`.
        options: of the steps.
    """
    way, left, done = np.sign(amount), abs(amount), 0.0
    lower, upper = np.minimum(manifold.lower[0], q), np.maximum(manifold.upper[0], q)
    while left > 0:
        step = min(left, options.longest)
        t = way * basis[number]
        ends, gaps = project(
            manifold.kernels, (q + step * t)[None], manifold.goals[0], lower, upper
        )
        if not gaps[0] <= CLOSED or (ends[0] - q) @ t < options.progress * step:
            break
        q, left, done = ends[0], left - step, done + step
        basis = null_basis(manifold, q, basis)
    return NullMotion(q, basis, float(way * done))
