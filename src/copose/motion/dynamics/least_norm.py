"""Least-norm tracking: the motion q̇ = J⁺V that follows an object without a plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.motion.path.knots import tip_goals
from copose.motion.path.object_motion import ObjectMotion
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.self_motion.projection import CLOSED, project


@dataclass(frozen=True)
class TrackingOptions:
    """Options of least-norm tracking."""

    steps: int = 8  # of closing between two knots: each goes the shortest way back to the chain
    beyond: float = 1e-9  # limits that count as kept, rad or m, and relative of speeds


@dataclass(frozen=True, eq=False)
class Tracked:
    """The postures that least-norm tracking comes to."""

    q: Array  # joint positions of all arms at the knots that it reaches, (k, N)
    reason: str | None  # why it goes no farther, None where it reaches the last


def tracked(
    model: PostureModel,
    journey: ObjectMotion,
    first: Sequence[Array],
    count: int,
    duration: float,
    options: TrackingOptions = TrackingOptions(),
) -> Tracked:
    """The least-norm motion from a first posture, by arm (n_i,), as far as limits allow."""
    cell, reach, reason, steps = model.cell, count, None, options.steps
    phases = np.linspace(0.0, 1.0, steps * (count - 1) + 1)
    motions = []
    for i, (arm, kernels) in enumerate(zip(cell.arms, model.arms, strict=True)):
        goals, free = tip_goals(cell, journey, i, phases), np.full(arm.n, np.inf)
        q, postures = first[i], [first[i]]
        longest = np.array([joint.velocity for joint in arm.joints]) * duration / (count - 1)
        for k in range(1, reach):
            for step in range(steps * (k - 1) + 1, steps * k + 1):
                ends, gaps = project(kernels, q[None], goals[step], -free, free, steps=12)
                q = ends[0]
            why: str | None = "out of reach"
            if gaps[0] <= CLOSED:
                why = _fault(model, i, q, postures[-1], longest, options.beyond)
            if why is not None:
                reach = k
                reason = f"arm {arm.name!r}, {duration * k / (count - 1):.3g} s: {why}"
                break
            postures.append(q)
        motions.append(np.array(postures))
    return Tracked(np.hstack([motion[:reach] for motion in motions]), reason)


def _fault(
    model: PostureModel, i: int, q: Array, before: Array, longest: Array, beyond: float
) -> str | None:
    """The limit that a posture of arm i breaks, or the step to it from the one before."""
    cell = model.cell
    arm = cell.arms[i]
    for j, joint in enumerate(arm.joints):
        if q[j] < cell.lower[i][j] - beyond or q[j] > cell.upper[i][j] + beyond:
            return f"joint {joint.name!r} beyond its limits"
        if abs(q[j] - before[j]) > longest[j] * (1 + beyond):
            return f"joint {joint.name!r} faster than it can be"
    return None
