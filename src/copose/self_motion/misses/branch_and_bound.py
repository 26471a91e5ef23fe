"""Proof that an arm cannot reach a goal: branch and bound over boxes of joint positions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array
from copose.robots import Arm, finite_range
from copose.robots.reach_bounds import levers, out_of_reach
from copose.self_motion.kernels import ArmKernels


@dataclass(frozen=True)
class BranchAndBoundOptions:
    """Effort of the branch and bound over boxes."""

    boxes: int = 120_000  # looked at before the proof is given up
    undecided: int = 2_000  # so many, none of them ruled out, show that the ranges are too wide
    rounding: float = 1e-9  # of a distance or an angle, m or rad


def excluded(
    arm: Arm,
    kernels: ArmKernels,
    lower: Array,
    upper: Array,
    goal: Array,
    *,
    rigid: bool,
    options: BranchAndBoundOptions = BranchAndBoundOptions(),
) -> bool:
    """Proof that no posture within the joint limits brings the tip to a goal.

    Boxes of joint positions are halved until the tip at the middle of each box is farther from the
    goal than the joints can move it within the box.

    Args:
        arm: the arm's numbers.
        kernels: of the arm.
        lower: joint limits, (n,).
        upper: alike.
        goal: tip position and quaternion, (7,), see `ReachBound.missed`.
        rigid: whether the orientation of the tip counts.
        options: effort of the search.

    Returns:
        True if there is a proof; False if a posture exists or nothing is known.
    """
    if out_of_reach(arm, lower, upper, goal, rigid=rigid):
        return True
    low, high = finite_range(lower, upper)
    reach = levers(arm)
    turning = np.array([joint.kind == "revolute" for joint in arm.joints], dtype=float)
    if not np.all(np.isfinite(reach)) or not np.all(np.isfinite([low, high])):
        return False
    middle, half = (low + high)[None] / 2, (high - low)[None] / 2
    seen = 0
    while len(middle):
        seen += len(middle)
        if seen + 2 * len(middle) > options.boxes:
            return False
        off = kernels.gap(middle, goal)
        near = np.linalg.norm(off[:, :3], axis=1) <= half @ reach + options.rounding
        if rigid:
            near &= 2 * np.linalg.norm(off[:, 4:], axis=1) <= half @ turning + options.rounding
        if len(middle) > options.undecided and near.all():
            return False
        middle, half = middle[near], half[near]
        widest = (half * (reach + turning * rigid)).argmax(axis=1)
        rows = np.arange(len(half))
        half = half.copy()
        half[rows, widest] /= 2
        step = np.zeros_like(half)
        step[rows, widest] = half[rows, widest]
        middle, half = np.vstack([middle - step, middle + step]), np.vstack([half, half])
    return True
