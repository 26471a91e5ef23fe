"""The pairs of solids that are tested against each other."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from copose.collision.shapes.solids import Solid
from copose.robots import Arm


def possible_pairs(
    solids: Sequence[Solid], arms: Sequence[Arm], mounts: Collection[tuple[int, str]]
) -> list[tuple[int, int]]:
    """All pairs i < j but those that are rigidly attached, stand still, or may touch.

    Args:
        solids: all of them.
        arms: the arms.
        mounts: (arm, name) of the static solids that an arm's first joint hangs on.
    """
    return [
        (i, j)
        for j, b in enumerate(solids)
        for i, a in enumerate(solids[:j])
        if not (_may_touch(a, b, arms, mounts) or _may_touch(b, a, arms, mounts))
    ]


def _may_touch(
    a: Solid, b: Solid, arms: Sequence[Arm], mounts: Collection[tuple[int, str]]
) -> bool:
    """True where b is one body with a, stands still as a does, or is next to a in its chain."""
    one, other = a.carrier, b.carrier
    if one == other or (one.static and other.static):
        return True
    if one.kind != "joint":
        return False
    if other.kind == "joint":
        return one.arm == other.arm and abs(one.joint - other.joint) == 1
    if other.kind == "object":
        return one.joint == arms[one.arm].n - 1
    return one.joint == 0 and (one.arm, b.name) in mounts
