"""Cubic Hermite curves between the knots of a motion, and how far they open the closed chain."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from copose.measurement.meter import closure_errors
from copose.motion.curve.differences import spline_slopes
from copose.motion.path.knots import tip_goals
from copose.motion.path.object_motion import ObjectMotion
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.self_motion.projection import project


def hermite_points(q: Array, rates: Array, step: float, part: float) -> Array:
    """Joint positions at a part of every interval, (n − 1, N).

    Args:
        q: at the knots, (n, N).
        rates: alike.
        step: between knots, s.
        part: of an interval, 0 … 1.
    """
    return _cubic(q[:-1], q[1:], step * rates[:-1], step * rates[1:], part)


def spline_points(q: Array, phases: Array) -> Array:
    """Joint positions, (count, N), on the spline through uniform knots, at rest at both ends.

    Args:
        q: at the knots, (n, N).
        phases: shares of the duration, (count,).
    """
    k = np.minimum((phases * (len(q) - 1)).astype(np.intp), len(q) - 2)
    rates = spline_slopes(q, 1.0)
    return _cubic(q[k], q[k + 1], rates[k], rates[k + 1], (phases * (len(q) - 1) - k)[:, None])


def _cubic(q: Array, after: Array, rise: Array, later: Array, s: float | Array) -> Array:
    """Cubics from q to q after them by their rates, per interval, at a part s of it."""
    return np.asarray(
        (1 + 2 * s) * (1 - s) ** 2 * q
        + s**2 * (3 - 2 * s) * after
        + s * (1 - s) * ((1 - s) * rise - s * later)
    )


def opening(
    model: PostureModel,
    journey: ObjectMotion,
    q: Sequence[Array],
    rates: Sequence[Array],
    duration: float,
    parts: Sequence[float] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9),
) -> float:
    """The largest opening of the chain between knots, m or rad.

    Args:
        model: what is built.
        journey: the object's.
        q: joint positions by arm, (n, n_i).
        rates: alike.
        duration: s.
        parts: of every interval at which the chain is looked at; it opens most near the middle.
    """
    cell, n = model.cell, len(q[0])
    space, worst = cell.system.space, 0.0
    begins = np.linspace(0.0, 1.0, n)[:-1]
    for part in parts:
        phases = begins + part / (n - 1)
        for i, (joints, joint_rates) in enumerate(zip(q, rates, strict=True)):
            between = hermite_points(joints, joint_rates, duration / (n - 1), part)
            gap = model.arms[i].gap(between, tip_goals(cell, journey, i, phases))
            errors = closure_errors(gap[:, list(space.linear)], gap[:, 3:], space.rigid)
            worst = max(worst, float(errors.max()))
    return worst


def closed_at(
    model: PostureModel, journey: ObjectMotion, q: Sequence[Array], phases: Array
) -> list[Array]:
    """Projections of postures onto the closed chain, by arm (count, n_i), one for each instant; as
    near to closed as they come.
    """
    cell = model.cell
    return [
        project(
            model.arms[i], joints, tip_goals(cell, journey, i, phases),
            cell.lower[i], cell.upper[i],
        )[0]
        for i, joints in enumerate(q)
    ]  # fmt: skip
