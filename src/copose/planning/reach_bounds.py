"""Whether a tip is where no posture of its arm can bring it: bounds that hold, not searches."""

from __future__ import annotations

import numpy as np

from copose.planning.arm_kernels import ArmKernels
from copose.poses import Array, rotation_rows
from copose.robots import Arm, finite_range

# Boxes of joint positions that are looked at before a proof is given up.
_BOXES = 120_000
# What rounding may make of a distance, m or rad.
_ROUNDING = 1e-9


def levers(arm: Arm) -> Array:
    """How far the tip comes at most for a rad or m of each joint, (n,)."""
    spans = _spans(arm)
    return np.array([
        1.0 if joint.kind == "prismatic" else float(spans[k + 1 :].sum())
        for k, joint in enumerate(arm.joints)
    ])  # fmt: skip


def too_far(arm: Arm, goal: Array, *, rigid: bool) -> float:
    """By how much links are too short, m; none are where that is not above zero.

    Args:
        arm: it.
        goal: of its tip in the root frame, position and quaternion, (7,).
        rigid: whether its orientation is asked for.
    """
    spans, first = _spans(arm), arm.joints[0].placement.position
    ways = [(goal[:3], spans[1:] if arm.joints[0].kind == "revolute" else spans)]
    if rigid and arm.n > 1 and arm.joints[-1].kind == "revolute":
        # The last joint turns about its own origin: where the tip is to be says where that is.
        back = arm.tip.rotation.T @ -arm.tip.position
        turned = np.array(rotation_rows(goal[3:]), dtype=float)
        ways.append((goal[:3] + turned @ back, ways[0][1][:-1]))
    return max(float(np.linalg.norm(end - first) - lengths.sum()) for end, lengths in ways)


def excluded(
    arm: Arm, kernels: ArmKernels, lower: Array, upper: Array, goal: Array, *, rigid: bool
) -> bool:
    """Whether no posture within limits brings the tip to a goal: boxes of joint positions are cut
    in halves until in each the middle is farther off than the joints can make good.

    Args:
        arm: it.
        kernels: its own.
        lower: limits of its joints, (n,).
        upper: alike.
        goal: see `too_far`.
        rigid: whether its orientation is asked for.
    """
    if too_far(arm, goal, rigid=rigid) > _ROUNDING:
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
        if seen + 2 * len(middle) > _BOXES:
            return False
        off = kernels.gap(middle, goal)
        near = np.linalg.norm(off[:, :3], axis=1) <= half @ reach + _ROUNDING
        if rigid:
            near &= 2 * np.linalg.norm(off[:, 4:], axis=1) <= half @ turning + _ROUNDING
        middle, half = middle[near], half[near]
        widest = (half * (reach + turning * rigid)).argmax(axis=1)
        rows = np.arange(len(half))
        half = half.copy()
        half[rows, widest] /= 2
        step = np.zeros_like(half)
        step[rows, widest] = half[rows, widest]
        middle, half = np.vstack([middle - step, middle + step]), np.vstack([half, half])
    return True


def _spans(arm: Arm) -> Array:
    """From each joint's frame to the next, m at most, (n + 1,): the first from the root, the last
    to the tip.
    """
    lengths = [float(np.linalg.norm(joint.placement.position)) for joint in arm.joints]
    spans = np.array([*lengths, float(np.linalg.norm(arm.tip.position))])
    for k, joint in enumerate(arm.joints):
        if joint.kind == "prismatic":
            spans[k + 1] += max(abs(joint.lower), abs(joint.upper))
    return spans
