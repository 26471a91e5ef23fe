"""The start of an arm: its posture before anything is solved."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from copose.poses import Array, Pose
from copose.robots.arm import Arm


@dataclass(frozen=True, eq=False)
class ArmStart:
    """An arm at its start, and the distance of its tip from its grasp there."""

    arm: Arm
    joints: Array  # positions, rad or m, (n,)
    object: Pose  # T_world_object
    rigid: bool  # whether the grasp's orientation counts
    given: bool  # whether the joints are the problem's; else they come from the seed

    @cached_property
    def frames(self) -> tuple[Pose, ...]:
        """Root, joints and tip in the world."""
        return self.arm.frames(self.joints)

    @property
    def tip(self) -> Pose:
        """The pose of the tip in the world, T_world_tip."""
        return self.frames[-1]

    @property
    def tip_in_object(self) -> Pose:
        """T_object_tip at the start."""
        return self.object.inverse() @ self.tip

    @property
    def grasp(self) -> Pose:
        """The pose of the grasp in the world, where the tip should be."""
        return self.object @ self.arm.grasp

    @property
    def gap(self) -> float:
        """Distance of the tip from its grasp, m."""
        return float(np.linalg.norm(self.tip.position - self.grasp.position))

    @property
    def turn(self) -> float:
        """Angle between tip and grasp, rad, 0 … π; zero where orientation does not count."""
        if not self.rigid:
            return 0.0
        scalar, *vector = (self.grasp.inverse() @ self.tip).quaternion
        return 2 * math.atan2(math.hypot(*vector), abs(scalar))

    @property
    def closed(self) -> bool:
        """True where the tip misses its grasp by less than 1e-6 m and rad."""
        return max(self.gap, self.turn) <= 1e-6

    @property
    def miss(self) -> str:
        """Gap and turn in words."""
        turned = f" and {round(math.degrees(self.turn), 6):.3g}°" if self.rigid else ""
        return f"{round(self.gap, 9):.3g} m{turned}"
