"""Least-norm tracking: the motion q̇ = J⁺V that follows an object without a plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.motion.curve.hermite import goals
from copose.motion.path.object_motion import ObjectMotion
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.self_motion.projection import CLOSED, project

# Steps of closing between two knots: each goes the shortest way back to the chain.
_STEPS = 8
_BEYOND = 1e-9


@dataclass(frozen=True, eq=False)
class Tracked:
    """Where it comes to.

    Attributes:
        q: joint positions of all arms at the knots that it reaches, (k, N).
        reason: why it goes no farther, None where it reaches the last.
    """

    q: Array
    reason: str | None


def tracked(
    model: PostureModel, journey: ObjectMotion, first: Sequence[Array], count: int, duration: float
) -> Tracked:
    """Follow a journey from its first posture, by arm (n_i,), as far as limits allow."""
    cell, reach, reason = model.cell, count, None
    phases = np.linspace(0.0, 1.0, _STEPS * (count - 1) + 1)
    columns = []
    for i, (arm, kernels) in enumerate(zip(cell.arms, model.arms, strict=True)):
        there, free = goals(cell, journey, i, phases), np.full(arm.n, np.inf)
        q, mine = first[i], [first[i]]
        speeds = np.array([joint.velocity for joint in arm.joints]) * duration / (count - 1)
        for k in range(1, reach):
            for step in range(_STEPS * (k - 1) + 1, _STEPS * k + 1):
                ends, gaps = project(kernels, q[None], there[step], -free, free, steps=12)
                q = ends[0]
            why = _fault(model, i, q, mine[-1], speeds) if gaps[0] <= CLOSED else "out of reach"
            if why is not None:
                reach = k
                reason = f"arm {arm.name!r}, {duration * k / (count - 1):.3g} s: {why}"
                break
            mine.append(q)
        columns.append(np.array(mine))
    return Tracked(np.hstack([mine[:reach] for mine in columns]), reason)


def _fault(model: PostureModel, i: int, q: Array, before: Array, reach: Array) -> str | None:
    """What limit a posture of arm i breaks, or the way to it from the one before."""
    cell = model.cell
    arm = cell.arms[i]
    for j, joint in enumerate(arm.joints):
        if q[j] < cell.lower[i][j] - _BEYOND or q[j] > cell.upper[i][j] + _BEYOND:
            return f"joint {joint.name!r} beyond its limits"
        if abs(q[j] - before[j]) > reach[j] * (1 + _BEYOND):
            return f"joint {joint.name!r} faster than it can be"
    return None
