"""Joint names of all arms in one list."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from copose.errors import InputError

ByArm = Mapping[str, Sequence[str]]


def unique_names(names: ByArm) -> dict[str, tuple[str, ...]]:
    """Joint names by arm; a name that two arms share has the arm's name and ``_`` in front.

    Raises:
        InputError: two are still equal.
    """
    count = Counter(joint for joints in names.values() for joint in joints)
    unique = {
        arm: tuple(f"{arm}_{joint}" if count[joint] > 1 else joint for joint in joints)
        for arm, joints in names.items()
    }
    joint, times = Counter(listed(unique)).most_common(1)[0]
    if times > 1:
        raise InputError(f"two joints would be called {joint!r}; rename an arm", key="joint_names")
    return unique


def listed(names: ByArm) -> list[str]:
    """The names of all arms' joints, in file order."""
    return [joint for joints in names.values() for joint in joints]
