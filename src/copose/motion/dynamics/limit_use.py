"""The torque or acceleration limit that a motion uses most of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from copose.cell.dynamics import CellDynamics
from copose.motion.dynamics.rates import JointRates
from copose.motion.path.knots import Course
from copose.poses import Array
from copose.posture.model import PostureModel

What: TypeAlias = Literal["hold", "torque", "acceleration"]


@dataclass(frozen=True)
class LimitUse:
    """The largest share of a limit that a motion uses."""

    what: What  # holding the object at rest, torques as it moves, or joint accelerations
    knot: int  # where
    arm: int  # its number
    joint: int  # its number in the arm
    times: float  # the share of the limit


def largest_strain(
    model: PostureModel, drive: JointRates, course: Course, q: Array, duration: float
) -> LimitUse:
    """The largest share of the limits that a motion, (n, N), has to keep; of torques of those whose
    largest share is smallest.
    """
    cell = model.cell
    parts = model.split(q)
    driven = drive.driven(course, parts, duration)
    limits = [[joint.acceleration for joint in arm.joints] for arm in cell.arms]
    shares: dict[What, Array] = {
        "acceleration": np.abs(np.hstack(driven.accelerations)) / np.concatenate(limits)
    }
    if driven.shares is not None:
        shares["torque"] = driven.shares
    held = np.flatnonzero(cell.held_knots(len(course)))
    if len(held):
        assert drive.capacity is not None
        shares["hold"] = np.zeros_like(q)
        shares["hold"][held] = [
            holding_shares(model, drive.capacity, course, k, q[k]) for k in held.tolist()
        ]
    what: What = max(shares, key=lambda name: float(shares[name].max()))
    table = shares[what]
    # Several joints give way at once; rounding must not choose between them.
    knot, column = np.argwhere(table >= table.max() * (1 - 1e-6))[0].tolist()
    return LimitUse(what, knot, *cell.joint(column), float(table.max()))


def holding_shares(
    model: PostureModel, capacity: CellDynamics, course: Course, k: int, q: Array
) -> Array:
    """Shares of torque limits, (N,), that a posture, (N,), uses to hold the object at rest at knot
    k, the largest at its least; ∞ where nothing holds it.
    """
    holding = capacity.holding(course.settings[k].cell)
    dynamics = capacity.dynamics(holding, model.split(q[None]))
    torques = dynamics.resting_torques(holding.hold)[0]
    T = np.concatenate(capacity.limits)
    return np.where(np.isfinite(torques), np.abs(torques) / T, np.inf)
