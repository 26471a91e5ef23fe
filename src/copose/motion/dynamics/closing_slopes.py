"""Rates at the knots that keep curves between them on the closed chain, within speed limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.motion.curve.differences import tridiagonal
from copose.motion.curve.hermite import hermite_points
from copose.motion.path.knots import tip_goals
from copose.motion.path.object_motion import ObjectMotion
from copose.poses import Array
from copose.posture.model import PostureModel


@dataclass(frozen=True)
class ClosingSlopeOptions:
    """Options of `closing_rates`."""

    steps: int = 6  # Gauss–Newton steps
    turn_weight: float = 1e-3  # damping: m of opening that a rad along the self-motion counts


def closing_rates(
    model: PostureModel,
    journey: ObjectMotion,
    i: int,
    q: Array,
    rates: Array,
    spare: Array,
    step: float,
    options: ClosingSlopeOptions = ClosingSlopeOptions(),
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
        options: of the iteration.
    """
    count = len(q)
    speeds = np.array([joint.velocity for joint in model.cell.arms[i].joints])
    phases = (np.arange(count - 1) + 0.5) / (count - 1)
    goals = tip_goals(model.cell, journey, i, phases)
    at_limit = np.zeros(count - 2, dtype=bool)
    for _ in range(options.steps):
        residual, slope = model.arms[i].residual(hermite_points(q, rates, step, 0.5), goals)
        # What the middle of an interval moves by with the rates before and after it.
        before = step / 8 * (slope @ spare[:-1, :, None])[:, :, 0]
        after = -step / 8 * (slope @ spare[1:, :, None])[:, :, 0]
        before[1:][at_limit], after[:-1][at_limit] = 0.0, 0.0
        damping = (options.turn_weight * step) ** 2
        own = (before**2).sum(axis=1)[1:] + (after**2).sum(axis=1)[:-1] + damping
        neighbour = np.append((before * after).sum(axis=1)[1:-1], 0.0)
        right = -(before * residual).sum(axis=1)[1:] - (after * residual).sum(axis=1)[:-1]
        moved = rates[1:-1] + tridiagonal(own, neighbour, right)[:, None] * spare[1:-1]
        within = within_speeds(moved, spare[1:-1], speeds)
        at_limit |= np.any(within != moved, axis=1)
        rates = np.vstack([rates[:1], within, rates[-1:]])
    return rates


def within_speeds(rates: Array, spare: Array, speeds: Array, inside: float = 1e-7) -> Array:
    """Rates, (count, n), moved along a direction each to within limits where they can be.

    Args:
        rates: rad/s or m/s.
        spare: the directions, (count, n).
        speeds: limits, (n,).
        inside: how far inside the limits the rates are put, relative.
    """
    most = (1 - inside) * speeds
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.stack([(-most - rates) / spare, (most - rates) / spare])
    low, high = np.nanmax(ends.min(axis=0), axis=1), np.nanmin(ends.max(axis=0), axis=1)
    step = np.clip(0.0, low, high)
    crossed = low > high
    # No step helps all joints: a long one along a motion that hardly moves the worst would harm.
    step[crossed] = 0.0
    return np.asarray(rates + step[:, None] * spare)
