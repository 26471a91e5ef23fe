"""What a reader of the numbers should know before trusting them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from copose.planning.cell import Cell
from copose.poses import Array


def standing_notes(cell: Cell) -> tuple[str, ...]:
    """Notes that hold for every posture of a cell."""
    notes = []
    ungeared = [arm.name for arm in cell.arms if not arm.geared]
    if ungeared:
        notes.append(f"gears are ignored: no armature is given for {', '.join(ungeared)}")
    if cell.system.space.rigid:
        notes.append(
            "linear and angular accelerations share one ellipsoid: its radii, and with them the "
            "Moore–Penrose load distribution, depend on the unit of length"
        )
    else:
        notes.append(
            "contacts transmit forces only: the ellipsoid ignores the moments that they exert on "
            "the object, which may spin"
        )
    sliding = [
        f"{arm.name}/{joint.name}"
        for arm in cell.arms
        for joint in arm.joints
        if joint.kind == "prismatic"
    ]
    if sliding:
        notes.append(f"unit torques count 1 N like 1 N·m at the prismatic joint {sliding[0]}")
    return tuple(notes)


def margin_notes(cell: Cell, joints: Sequence[Array]) -> tuple[str, ...]:
    """Which arms of a posture are nearer to a limit than joint_margin."""
    parts = zip(cell.arms, joints, cell.lower, cell.upper, strict=True)
    return tuple(
        f"arm {arm.name!r} is given within joint_margin of a limit"
        for arm, q, lower, upper in parts
        if np.any((q < lower) | (q > upper))
    )


def doubts(cell: Cell) -> tuple[str, ...]:
    """What else is doubtful about a problem, for `check`."""
    notes = []
    for arm in cell.arms:
        notes += [
            f"joint {joint.name!r} of arm {arm.name!r} is locked at {joint.position:g}, outside "
            f"its limits {joint.lower:g} … {joint.upper:g}"
            for joint in arm.locked
            if not joint.lower - 1e-6 <= joint.position <= joint.upper + 1e-6
        ]
    return (*standing_notes(cell), *notes)
