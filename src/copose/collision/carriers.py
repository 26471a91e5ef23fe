"""What moves a solid, and where that is at given joint positions, in plain numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from copose.poses import Array, Pose
from copose.robots import Arm, Joint


@dataclass(frozen=True)
class Carrier:
    """A frame that solids are fixed to.

    Attributes:
        kind: the world; the object; an arm's root frame; a joint's frame, after its motion.
        arm: which arm, −1 for world and object.
        joint: which of its free joints, −1 for the root.
    """

    kind: Literal["world", "object", "root", "joint"]
    arm: int = -1
    joint: int = -1

    @property
    def static(self) -> bool:
        """Whether neither joints nor the object move it."""
        return self.kind in ("world", "root")


WORLD, OBJECT = Carrier("world"), Carrier("object")


def carriers_of(arms: Sequence[Arm]) -> tuple[Carrier, ...]:
    """World, object, then root and joints of every arm: the order of `Placements`."""
    found = [WORLD, OBJECT]
    for i, arm in enumerate(arms):
        found.append(Carrier("root", i))
        found += [Carrier("joint", i, j) for j in range(arm.n)]
    return tuple(found)


@dataclass(frozen=True, eq=False)
class Placements:
    """Placements of all carriers in the world, in the order of `carriers_of`.

    Attributes:
        rotations: R_world_carrier, shape (c, 3, 3).
        positions: origins in the world, m, shape (c, 3).
    """

    rotations: Array
    positions: Array


def carrier_poses(
    arms: Sequence[Arm], bases: Sequence[Pose], q: Sequence[ArrayLike], object_pose: Pose
) -> Placements:
    """T_world_root ∏ placement_j · motion_j(q_j): where every carrier is.

    Args:
        arms: the arms.
        bases: T_world_root of each; `Arm.base` where bases are not free.
        q: joint positions of each, (n,).
        object_pose: T_world_object.
    """
    rotations, positions = [np.eye(3), object_pose.rotation], [np.zeros(3), object_pose.position]
    for arm, base, joints in zip(arms, bases, q, strict=True):
        rotation, position = base.rotation, base.position
        rotations.append(rotation)
        positions.append(position)
        for joint, value in zip(arm.joints, np.asarray(joints, dtype=float), strict=True):
            position = rotation @ joint.placement.position + position
            rotation = rotation @ joint.placement.rotation
            if joint.kind == "revolute":
                rotation = rotation @ _turn(joint, value)
            else:
                position = position + rotation @ joint.axis * value
            rotations.append(rotation)
            positions.append(position)
    return Placements(np.array(rotations), np.array(positions))


def _turn(joint: Joint, angle: float) -> Array:
    along = np.outer(joint.axis, joint.axis)
    x, y, z = joint.axis
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn: Array = along + (np.eye(3) - along) * np.cos(angle) + skew * np.sin(angle)
    return turn
