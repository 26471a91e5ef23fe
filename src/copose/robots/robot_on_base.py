"""The robot that an arm is part of, to tell whether two arms move independently."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from copose.poses import Pose


@dataclass(frozen=True, eq=False)
class RobotOnBase:
    """The robot that an arm is part of, on its base."""

    source: object  # its file, with the arguments of xacro
    origin: Pose  # T_world_universe of the whole robot
    # The movable joints above the tip, from its root link: the position of a locked one, rad or m,
    # and None where the arm moves it.
    hangs_on: Mapping[str, float | None]

    def same(self, other: RobotOnBase) -> bool:
        """True for two arms that are parts of one robot: one file at one base."""
        return self.source == other.source and coincide(self.origin, other.origin)

    def clash(self, other: RobotOnBase) -> str | None:
        """The reason why the two arms do not move independently; None where they do."""
        if not self.same(other):
            return None
        common = {
            joint: (position, other.hangs_on[joint])
            for joint, position in self.hangs_on.items()
            if joint in other.hangs_on
        }
        moved = [joint for joint, both in common.items() if None in both]
        if moved:
            at = {
                joint: next((position for position in both if position is not None), 0.0)
                for joint, both in common.items()
                if both[0] is None or both[0] != both[1]
            }
            locked = ", ".join(f"{_toml_key(joint)} = {position}" for joint, position in at.items())
            return (
                f"both hang on {', '.join(moved)}, and so are not independent; lock in both, where "
                f"you want: locked = {{ {locked} }}"
            )
        for joint, (position, other_position) in common.items():
            if position != other_position:
                return (
                    f"hold joint {joint!r} at different positions, {position:g} and "
                    f"{other_position:g}; lock it at one"
                )
        return None


def coincide(one: Pose, other: Pose) -> bool:
    """True for poses that are equal to 1e-9, in m and in the entries of rotations."""
    first, second = (np.column_stack([pose.rotation, pose.position]) for pose in (one, other))
    return np.allclose(first, second, rtol=0, atol=1e-9)


def _toml_key(name: str) -> str:
    return name if re.fullmatch(r"[\w-]+", name, re.ASCII) else json.dumps(name, ensure_ascii=False)
