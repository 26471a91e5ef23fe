"""Transitions from one posture to another along self-motions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np

from copose.errors import InputError
from copose.poses import Array
from copose.posture import Planner
from copose.problem import Problem
from copose.self_motion.curves.self_motion_curve import SelfMotionCurve

Joints: TypeAlias = Mapping[str, Sequence[float]]


def self_motion_way(
    planner: Planner,
    problem: Problem,
    start: Joints,
    end: Joints,
    spare: Mapping[str, int],
    frames: int = 16,
) -> list[dict[str, list[float]]]:
    """Postures, joints by arm, from one to another that hold the object all the way; none where an
    arm would have to let go, or where that cannot be said at once.
    """
    ways: dict[str, Array] = {}
    for arm, q in start.items():
        if np.abs(np.subtract(end[arm], q)).max() <= 1e-6:
            ways[arm] = np.repeat(np.array(end[arm])[None], frames, axis=0)
            continue
        if spare[arm] != 1:
            return []
        try:
            first, last = (
                planner.self_motion(joints, arm, problem=problem) for joints in (start, end)
            )
        except InputError:
            return []
        way = _along(first, last, frames)
        if way is None:
            return []
        ways[arm] = way
    return [{arm: way[k].tolist() for arm, way in ways.items()} for k in range(frames)]


def _along(first: SelfMotionCurve, last: SelfMotionCurve, frames: int) -> Array | None:
    """Postures of an arm between its places on two curves, (frames, n); None where these are not
    connected within limits.
    """
    if first.present is None or last.present is None or first.branch != last.branch:
        return None
    piece = first.piece(first.present)
    other = last.piece(last.present)
    if piece is None or other is None or not np.allclose(piece, other, rtol=0, atol=1e-6):
        return None
    # Slow at both ends.
    t = (1 - np.cos(np.linspace(0, np.pi, frames))) / 2
    return first.postures(first.present + t * (last.present - first.present))
