"""A motion between its knots: cubic Hermite curves, and how far they open the chain."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from copose.cell.cell import Cell
from copose.measurement.meter import closure_errors
from copose.motion.path.knots import tridiagonal
from copose.motion.path.object_motion import ObjectMotion
from copose.poses import Array, quaternion_product, rotation_rows
from copose.posture.model import PostureModel
from copose.self_motion.projection import project

# Parts of an interval at which the chain is looked at: openings are largest in the middle.
BETWEEN = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
# Steps towards slopes that close, and what a rad that they move a knot's neighbourhood by counts
# against a metre of opening.
_STEPS, _WEIGHT = 6, 1e-3
# How far inside speed limits rates are put.
_INSIDE = 1 - 1e-7


def hermite(q: Array, rates: Array, step: float, part: float) -> Array:
    """Joint positions at a part of every interval, (n − 1, N).

    Args:
        q: at the knots, (n, N).
        rates: alike.
        step: between knots, s.
        part: of an interval, 0 … 1.
    """
    s = part
    return np.asarray(
        (1 + 2 * s) * (1 - s) ** 2 * q[:-1]
        + s**2 * (3 - 2 * s) * q[1:]
        + step * s * (1 - s) * ((1 - s) * rates[:-1] - s * rates[1:])
    )


def goals(cell: Cell, journey: ObjectMotion, i: int, phases: Array) -> Array:
    """Where the object wants the tip of arm i, see `Placement`, (count, 7)."""
    base, grasp = cell.arms[i].base, cell.arms[i].grasp
    positions, quaternions = journey.places(phases)
    rotations = np.array(rotation_rows(quaternions.T)).transpose(2, 0, 1)
    tips = positions + rotations @ grasp.position - base.position
    back = base.quaternion * np.array([1.0, -1.0, -1.0, -1.0])
    turned = quaternion_product(back, quaternion_product(quaternions.T, grasp.quaternion))
    return np.hstack([tips @ base.rotation, np.stack(turned, axis=1)])


def opening(
    model: PostureModel,
    journey: ObjectMotion,
    q: Sequence[Array],
    rates: Sequence[Array],
    duration: float,
) -> float:
    """The largest opening of the chain between knots, m or rad.

    Args:
        model: what is built.
        journey: the object's.
        q: joint positions by arm, (n, n_i).
        rates: alike.
        duration: s.
    """
    cell, n = model.cell, len(q[0])
    space, worst = cell.system.space, 0.0
    begins = np.linspace(0.0, 1.0, n)[:-1]
    for part in BETWEEN:
        phases = begins + part / (n - 1)
        for i, (mine, rate) in enumerate(zip(q, rates, strict=True)):
            there = hermite(mine, rate, duration / (n - 1), part)
            gap = model.arms[i].gap(there, goals(cell, journey, i, phases))
            errors = closure_errors(gap[:, list(space.linear)], gap[:, 3:], space.rigid)
            worst = max(worst, float(errors.max()))
    return worst


def closed_at(
    model: PostureModel, journey: ObjectMotion, q: Sequence[Array], phases: Array
) -> list[Array]:
    """Postures near some, by arm (count, n_i), closed at these instants as far as they can be."""
    cell, found = model.cell, []
    for i, mine in enumerate(q):
        ends, _ = project(
            model.arms[i], mine, goals(cell, journey, i, phases), cell.lower[i], cell.upper[i]
        )
        found.append(ends)
    return found


def closing_slopes(
    model: PostureModel,
    journey: ObjectMotion,
    i: int,
    q: Array,
    rates: Array,
    spare: Array,
    step: float,
) -> Array:
    """Rates of arm i, (n, n_i), with which its curves between knots open the chain least.

    Gauss–Newton steps on the openings half way between knots: along a self-motion that turns within
    a knot or two, slopes decide how far the curve leaves it. Inner rates move, along the
    self-motion only, no farther than closes something and within speed limits.

    Args:
        model: what is built.
        journey: the object's.
        i: the arm.
        q: its joint positions at the knots, (n, n_i).
        rates: alike, with J·rates the contact's velocity.
        spare: direction of the self-motion at each knot, (n, n_i).
        step: between knots, s.
    """
    count = len(q)
    speeds = np.array([joint.velocity for joint in model.cell.arms[i].joints])
    phases = (np.arange(count - 1) + 0.5) / (count - 1)
    there = goals(model.cell, journey, i, phases)
    held = np.zeros(count - 2, dtype=bool)
    for _ in range(_STEPS):
        residual, slope = model.arms[i].residual(hermite(q, rates, step, 0.5), there)
        # What the middle of an interval moves by with the rates before and after it.
        before = step / 8 * (slope @ spare[:-1, :, None])[:, :, 0]
        after = -step / 8 * (slope @ spare[1:, :, None])[:, :, 0]
        before[1:][held], after[:-1][held] = 0.0, 0.0
        own = (before**2).sum(axis=1)[1:] + (after**2).sum(axis=1)[:-1] + (_WEIGHT * step) ** 2
        beside = np.append((before * after).sum(axis=1)[1:-1], 0.0)
        right = -(before * residual).sum(axis=1)[1:] - (after * residual).sum(axis=1)[:-1]
        moved = rates[1:-1] + tridiagonal(own, beside, right)[:, None] * spare[1:-1]
        kept = within_speeds(moved, spare[1:-1], speeds)
        held |= np.any(kept != moved, axis=1)
        rates = np.vstack([rates[:1], kept, rates[-1:]])
    return rates


def within_speeds(rates: Array, spare: Array, speeds: Array) -> Array:
    """Rates, (count, n), moved along a direction each to within limits where they can be."""
    most = _INSIDE * speeds
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.stack([(-most - rates) / spare, (most - rates) / spare])
    low, high = np.nanmax(ends.min(axis=0), axis=1), np.nanmin(ends.max(axis=0), axis=1)
    step = np.clip(0.0, low, high)
    crossed = low > high
    # No step helps all joints: a long one along a motion that hardly moves the worst would harm.
    step[crossed] = 0.0
    return np.asarray(rates + step[:, None] * spare)
