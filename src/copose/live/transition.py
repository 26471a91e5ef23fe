"""The way from one posture to another, along self-motions where both are on them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from copose.errors import InputError
from copose.poses import Array
from copose.posture import Planner
from copose.problem import Problem
from copose.self_motion.curves.self_motion_curve import SelfMotionCurve

# Pictures of a transition.
FRAMES = 16
# Joints closer than this, rad or m, are where they were.
_SAME = 1e-6

Joints = Mapping[str, Sequence[float]]


def self_motion_way(
    planner: Planner, problem: Problem, start: Joints, end: Joints, spare: Mapping[str, int]
) -> list[dict[str, list[float]]]:
    """Postures from a posture to another that hold the object all the way; none where an arm would
    have to let go, or where that cannot be said at once.

    Args:
        planner: of the problem.
        problem: with the object where it is.
        start: joint positions, rad or m, by arm; `end` alike.
        end: alike.
        spare: degrees of freedom to spare, by arm.
    """
    ways: dict[str, Array] = {}
    for arm, q in start.items():
        if np.abs(np.subtract(end[arm], q)).max() <= _SAME:
            ways[arm] = np.repeat(np.array(end[arm])[None], FRAMES, axis=0)
            continue
        if spare[arm] != 1:
            return []
        try:
            here, there = (
                planner.self_motion(joints, arm, problem=problem) for joints in (start, end)
            )
        except InputError:
            return []
        way = _along(here, there)
        if way is None:
            return []
        ways[arm] = way
    return [{arm: way[k].tolist() for arm, way in ways.items()} for k in range(FRAMES)]


def _along(here: SelfMotionCurve, there: SelfMotionCurve) -> Array | None:
    """Postures from where one curve's arm is to where the other's is, (FRAMES, n); None where these
    are not connected within limits.
    """
    if here.present is None or there.present is None or here.branch != there.branch:
        return None
    piece = here.piece(here.present)
    other = there.piece(there.present)
    if piece is None or other is None or not np.allclose(piece, other, rtol=0, atol=_SAME):
        return None
    # Slow at both ends.
    t = (1 - np.cos(np.linspace(0, np.pi, FRAMES))) / 2
    return here.postures(here.present + t * (there.present - here.present))
