"""Projection of joint positions onto the closure of one arm, many at once."""

from __future__ import annotations

import numpy as np

from copose.poses import Array
from copose.self_motion.kernels import ArmKernels

# The norm of a closure's residual up to which a posture holds the object, m and rad.
CLOSED = 1e-9


def project(
    kernels: ArmKernels,
    q: Array,
    goal: Array,
    lower: Array,
    upper: Array,
    *,
    steps: int = 60,
    closed: float = 1e-13,
) -> tuple[Array, Array]:
    """Projection onto {q : closure(q) = 0, lower ≤ q ≤ upper} by damped Gauss–Newton steps.

    With the object held still the arms close independently of one another, and an arm need not wait
    for the others' luck.

    Args:
        kernels: of the arm.
        q: postures to start from, (count, n).
        goal: of the tip, see `KernelInputs`, (7,) or one for each posture.
        lower: joint limits, −inf where there is none, (n,) or one for each posture.
        upper: alike.
        steps: at most, rounded up to a multiple of `ArmKernels.steps`.
        closed: a residual that needs no further step.

    Returns:
        Postures (count, n) within the limits, and the norms of their residuals (count,).
    """
    n = kernels.n
    rows = np.empty((len(q), 3 * n))
    rows[:, n : 2 * n], rows[:, 2 * n :] = lower, upper
    rows[:, :n] = np.minimum(np.maximum(q, lower), upper)
    ends = kernels.closing(rows, goal)
    gaps = ends[:, n]
    for _ in range(1, -(-steps // kernels.steps)):
        active = (gaps > closed).nonzero()[0]
        if len(active) == 0:
            break
        rows[active, :n] = ends[active, :n]
        ends[active] = kernels.closing(rows[active], goal[active] if goal.ndim == 2 else goal)
    return ends[:, :n], gaps
