"""Motions along the same branches, with accelerations as small as they can be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.motion.curve.differences import bends
from copose.motion.path.knots import Course
from copose.poses import Array, Mask
from copose.posture.model import PostureModel
from copose.self_motion.projection import CLOSED, project


@dataclass(frozen=True)
class StraighteningOptions:
    """Options of `straightened`."""

    steps: int = 12  # Gauss–Newton steps
    longest: float = 0.3  # of a step, rad or m
    little: float = 1e-3  # step after which there is no other, rad or m
    damping: float = 1e-9  # of the normal equations, relative


def straightened(
    model: PostureModel,
    course: Course,
    q: Array,
    fixed: Mask,
    options: StraighteningOptions = StraighteningOptions(),
) -> Array:
    """The motion, (n, N), near a closed one with the least sum of squared second differences.

    Gauss–Newton steps along the self-motions of every knot, each closed again within limits.

    Args:
        model: what is built.
        course: at the knots.
        q: the motion, (n, N).
        fixed: joints at knots that stay, (n, N).
        options: of the steps.
    """
    edges = np.cumsum([kernels.n for kernels in model.arms])[:-1]
    parts = zip(np.split(q, edges, axis=1), np.split(fixed, edges, axis=1), strict=True)
    return np.hstack([
        _straight(model, course, i, joints, np.any(stay, axis=1), options)
        for i, (joints, stay) in enumerate(parts)
    ])  # fmt: skip


def _straight(
    model: PostureModel,
    course: Course,
    i: int,
    q: Array,
    fixed: Mask,
    options: StraighteningOptions,
) -> Array:
    """The same of arm i, (n, n_i)."""
    kernels, n = model.arms[i], len(q)
    lower, upper = model.cell.lower[i], model.cell.upper[i]
    D = bends(np.eye(n), 1.0)
    for _ in range(options.steps if kernels.n > kernels.m else 0):
        _, J = kernels.residual(q, course.goals[i])
        spare = np.linalg.qr(J.swapaxes(1, 2), mode="complete")[0][:, :, kernels.m :]
        spare[fixed] = 0.0
        # Of all second differences by all steps along self-motions.
        A = np.einsum("kl,lja->kjla", D, spare).reshape(q.size, -1)
        normal = A.T @ A
        normal += options.damping * np.trace(normal) * np.eye(len(normal))
        along = np.linalg.solve(normal, -A.T @ (D @ q).ravel()).reshape(n, -1, 1)
        step = (spare @ along)[:, :, 0]
        longest = float(np.abs(step).max())
        step *= min(1.0, options.longest / max(longest, options.little))
        moved, gaps = project(kernels, q + step, course.goals[i], lower, upper)
        q = np.where((gaps <= CLOSED)[:, None], moved, q)
        if longest < options.little:
            break
    return q
