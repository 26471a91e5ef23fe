"""Which solids are tested against each other."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from copose.collision.solids import Solid
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
    """Whether b, seen from a, is one body with it, stands still as it does, or is next to it."""
    mine, other = a.carrier, b.carrier
    if mine == other or (mine.static and other.static):
        return True
    if mine.kind != "joint":
        return False
    if other.kind == "joint":
        return mine.arm == other.arm and abs(mine.joint - other.joint) == 1
    if other.kind == "object":
        return mine.joint == arms[mine.arm].n - 1
    return mine.joint == 0 and (mine.arm, b.name) in mounts
