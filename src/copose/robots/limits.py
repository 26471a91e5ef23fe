"""Limits of an arm's joints as they are given, and notes where they are read otherwise."""

from __future__ import annotations

import numpy as np

from copose.errors import InputError, shown
from copose.poses import Array, frozen_array
from copose.problem import ArmSpec
from copose.robots.arm import Joint


class LimitNotes:
    """Notes on limits of an arm's joints that are read otherwise than its file says."""

    def __init__(self, no_limit: float = 1e6) -> None:
        """Begin without any; a position limit of a size or more stands for none."""
        self._no_limit = no_limit
        self._joints: dict[str, list[str]] = {}

    def positions(self, joint: str, limits: tuple[float, float]) -> tuple[float, float]:
        """Limits of a joint's position, without those that stand for none."""
        if any(self._no_limit <= abs(limit) < np.inf for limit in limits):
            self.note("position limits of 1e6 and more count as none", joint)
        lower, upper = (limit if abs(limit) < self._no_limit else np.inf for limit in limits)
        return -lower if lower == np.inf else lower, upper

    def positive(self, what: str, joint: str, limit: float | None, fault: str = "") -> float:
        """A limit of a quantity, named in the plural, that has to be positive; infinite where it is
        not, cannot be read, or is not given.
        """
        if limit is not None and limit > 0:
            return limit
        if limit is not None or fault:
            shown = "no number" if limit is None else f"{limit:g}"
            self.note(f"limits of {what} that are not above zero count as not given", joint, shown)
        return np.inf

    def told(self, arm: str) -> tuple[str, ...]:
        """One sentence for each kind of note, with the joints."""
        return tuple(
            f"arm {arm!r}: {what}: {', '.join(joints)}" for what, joints in self._joints.items()
        )

    def note(self, remark: str, joint: str, value: str = "") -> None:
        """Add a remark on a joint, or on a link."""
        self._joints.setdefault(remark, []).append(f"{joint} ({value})" if value else joint)


def check_lengths(spec: ArmSpec, names: tuple[str, ...], key: str) -> None:
    """Refuse a per-joint array of the wrong length, naming the joints it is for."""
    per_joint = (
        "start",
        "torque_limits",
        "position_limits",
        "velocity_limits",
        "acceleration_limits",
        "armature",
    )
    for field_name in per_joint:
        values = getattr(spec, field_name)
        if values is not None and len(values) != len(names):
            raise InputError(
                f"has {len(values)} entries; {len(names)} are needed, for {', '.join(names)}",
                key=f"{key}.{field_name}",
            )


def start_within_limits(spec: ArmSpec, joints: tuple[Joint, ...], key: str) -> Array | None:
    """The start of an arm's table, clipped where it exceeds a limit by rounding only."""
    if spec.start is None:
        return None
    for i, (position, joint) in enumerate(zip(spec.start, joints, strict=True)):
        if not joint.lower - 1e-6 <= position <= joint.upper + 1e-6:
            raise InputError(
                f"{shown(position)} is outside the limits of {joint.name}: "
                f"{joint.lower:g} … {joint.upper:g}",
                key=f"{key}.start[{i}]",
            )
    limits = [(joint.lower, joint.upper) for joint in joints]
    return frozen_array(np.clip(spec.start, *np.array(limits).T))
