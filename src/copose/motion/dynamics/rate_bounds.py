"""Upper bounds on the speed and acceleration of a tip in any posture: a proof, not a search."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from copose.cell.cell import Cell
from copose.motion.path.knots import Course
from copose.poses import Array
from copose.robots.reach_bounds import levers


@dataclass(frozen=True)
class Outrun:
    """A grasp that outruns its arm."""

    what: Literal["speed", "acceleration"]  # its speed or its acceleration
    arm: int  # its number
    knot: int  # of the course
    asked: float  # m/s or rad/s, m/s² or rad/s²
    most: float  # what joints at their limits come to at most
    unit: str  # of both


def outrun(
    cell: Cell, course: Course, duration: float, step: float, unlimited: float = 1e9
) -> Outrun | None:
    """The grasp that outruns its arm most; None where none is known to.

    From rest to rest joints have what their accelerations give them in the time that there is; each
    rad of a joint moves the tip by no more than the links beyond it are long, and by twice as many
    joints its speed bends.

    Args:
        cell: whose arms they are.
        course: the object's.
        duration: s.
        step: between knots, s, within which differences do not see what rates do.
        unlimited: what stands in for no limit, in any unit.
    """
    linear = len(cell.system.space.linear)
    time = np.minimum(course.phases, 1 - course.phases) * duration + step
    known: list[Outrun] = []
    for i, arm in enumerate(cell.arms):
        lever = np.minimum(levers(arm), unlimited)
        turning = np.array([joint.kind == "revolute" for joint in arm.joints], dtype=float)
        speeds = np.minimum([joint.velocity for joint in arm.joints], unlimited)
        bends = np.minimum([joint.acceleration for joint in arm.joints], unlimited)
        rates = np.minimum(speeds, time[:, None] * bends)
        velocities = course.velocities[i] / duration
        accelerations = course.accelerations[i] / duration**2
        far = lever[np.maximum.outer(np.arange(arm.n), np.arange(arm.n))]
        swing = np.einsum("kj,ji,ki->k", rates, far, rates)
        turn = np.einsum("kj,ki->k", rates * turning, rates * turning)
        known += [
            *_beyond("speed", i, velocities[:, :linear], rates @ lever, "m/s"),
            *_beyond("speed", i, velocities[:, linear:], rates @ turning, "rad/s"),
            *_beyond("acceleration", i, accelerations[:, :linear], bends @ lever + swing, "m/s²"),
            *_beyond(
                "acceleration", i, accelerations[:, linear:], bends @ turning + turn, "rad/s²"
            ),
        ]
    return max(known, key=lambda grasp: grasp.asked / grasp.most, default=None)


def _beyond(
    what: Literal["speed", "acceleration"], arm: int, rates: Array, most: Array, unit: str
) -> list[Outrun]:
    """The knot where rates, (n, 2 or 3), exceed their bounds, (n,), most, if they do."""
    asked = np.linalg.norm(rates, axis=1)
    k = int((asked / np.maximum(most, np.finfo(float).tiny)).argmax())
    if not asked[k] > most[k] * (1 + 1e-9):
        return []
    return [Outrun(what, arm, k, float(asked[k]), float(most[k]), unit)]
