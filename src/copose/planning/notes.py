"""What a reader of the numbers should know before trusting them."""

from __future__ import annotations

from copose.planning.cell import Cell


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
    sliding = [
        f"{arm.name}/{joint.name}"
        for arm in cell.arms
        for joint in arm.joints
        if joint.kind == "prismatic"
    ]
    if sliding:
        notes.append(f"unit torques count 1 N like 1 N·m at the prismatic joint {sliding[0]}")
    return tuple(notes)


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
