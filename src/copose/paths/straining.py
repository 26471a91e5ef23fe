"""Which torque or acceleration limit a motion uses most of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from copose.paths.course import Course
from copose.paths.drive import Drive
from copose.planning.machinery import Machinery
from copose.poses import Array

What: TypeAlias = Literal["hold", "torque", "acceleration"]


@dataclass(frozen=True)
class Strain:
    """The largest share of a limit.

    Attributes:
        what: holding the object at rest, torques as it moves, or joint accelerations.
        knot: where.
        arm: its number.
        joint: its number in the arm.
        times: the share of the limit.
    """

    what: What
    knot: int
    arm: int
    joint: int
    times: float


def largest_strain(
    machinery: Machinery, drive: Drive, course: Course, q: Array, duration: float
) -> Strain:
    """Of a motion, (n, N), of those limits that it has to keep; torques are those whose largest
    share is smallest.
    """
    cell = machinery.cell
    parts = machinery.split(q)
    driven = drive.driven(course, parts, duration)
    limits = [[joint.acceleration for joint in arm.joints] for arm in cell.arms]
    shares: dict[What, Array] = {
        "acceleration": np.abs(np.hstack(driven.accelerations)) / np.concatenate(limits)
    }
    if driven.shares is not None:
        shares["torque"] = driven.shares
    if machinery.static:
        shares["hold"] = _held(machinery, course, q)
    what = max(shares, key=lambda name: float(shares[name].max()))
    table = shares[what]
    # Several joints give way at once; rounding must not choose between them.
    knot, column = np.argwhere(table >= table.max() * (1 - 1e-6))[0].tolist()
    edges = np.cumsum([0, *(arm.n for arm in cell.arms)])
    arm = int(np.searchsorted(edges, column, side="right")) - 1
    return Strain(what, knot, arm, column - int(edges[arm]), float(table.max()))


def _held(machinery: Machinery, course: Course, q: Array) -> Array:
    """Shares of torque limits that hold the object at rest, (n, N), the largest at its least; ∞
    where nothing does.
    """
    capacity = machinery.capacity
    assert capacity is not None
    T, found = np.concatenate(capacity.limits), np.empty_like(q)
    for k, setting in enumerate(course.settings):
        assert setting.holding is not None
        dynamics = capacity.dynamics(setting.holding, machinery.split(q[k][None]))
        torques = dynamics.resting_torques(setting.holding.hold)[0]
        found[k] = np.where(np.isfinite(torques), np.abs(torques) / T, np.inf)
    return found
