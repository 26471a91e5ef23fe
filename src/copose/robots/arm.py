"""An arm as plain numbers, and its start."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from copose.poses import Array, Pose, frozen_array, rotation_rows
from copose.problem import ArmSpec


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body in some frame: mass, kg; centre of mass, m; inertia about it, kg·m²."""

    mass: float
    com: Array
    inertia: Array

    def placed(self, pose: Pose) -> Body:
        """The same body seen from the frame in which ``pose`` places its own."""
        com = pose.rotation @ self.com + pose.position
        return Body(self.mass, com, pose.rotation @ self.inertia @ pose.rotation.T)

    def __add__(self, other: Body) -> Body:
        mass = self.mass + other.mass
        moment = self.mass * self.com + other.mass * other.com
        com = moment / mass if mass > 0 else self.com
        inertia = np.zeros((3, 3))
        for part in (self, other):
            offset = part.com - com
            inertia += part.inertia + part.mass * (
                offset @ offset * np.eye(3) - np.outer(offset, offset)
            )
        return Body(mass, frozen_array(com), frozen_array(inertia))


def joint_motion(kind: str, axis: Array, position: float) -> Pose:
    """The motion of a joint at a position, along its unit axis, m, or about it, rad."""
    if kind == "prismatic":
        return Pose.from_rpy(axis * position)
    quaternion = [math.cos(position / 2), *(axis * math.sin(position / 2))]
    return Pose.make(np.zeros(3), rotation_rows(quaternion), quaternion)


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint of one degree of freedom and the body it moves."""

    name: str  # as in the robot's file; ``joint1``, ``joint2``, … for a planar arm
    kind: Literal["revolute", "prismatic"]  # revolute (rad) or prismatic (m)
    axis: Array  # unit axis in the joint's frame
    # Joint frame at zero in the frame of the joint before it (the first: in the root).
    placement: Pose
    body: Body  # everything rigidly attached, in the joint's frame
    lower: float = -np.inf  # lowest position, −inf where there is none
    upper: float = np.inf  # highest position, inf where there is none
    velocity: float = np.inf  # speed limit, inf where there is none
    acceleration: float = np.inf  # limit of its acceleration, inf where there is none
    effort: float = np.inf  # torque or force limit, inf where there is none
    armature: float = 0.0  # reflected rotor inertia, added to M's diagonal

    def at(self, position: float) -> Pose:
        """T_before_joint at a position, rad or m."""
        return self.placement @ joint_motion(self.kind, self.axis, position)


@dataclass(frozen=True)
class LockedJoint:
    """A movable joint of the arm, or of what it carries, that is held still."""

    name: str
    position: float
    lower: float
    upper: float


@dataclass(frozen=True)
class Oddity:
    """An implausible number in a robot's file."""

    about: Literal["inertia", "effort", "speed"]
    text: str  # a sentence that names the link or the joint


@dataclass(frozen=True, eq=False)
class Arm:
    """A serial chain on a fixed base, and how it holds the object."""

    name: str  # as in the problem file
    model: str  # where the numbers come from, for the reader: a robot's file name, ``planar links``
    joints: tuple[Joint, ...]  # the free joints, root to tip
    base: Pose  # T_world_root
    tip: Pose  # tip frame in the last joint's frame
    grasp: Pose  # T_object_tip
    start: Array | None = None  # joint positions before, or None
    locked: tuple[LockedJoint, ...] = ()  # movable joints held still, on the chain or carried by it
    geared: bool = True  # whether the rotors' inertia is known
    free: tuple[str, ...] = ()  # which of ``base`` and ``grasp`` may be moved
    fixed: bool = False  # whether it is held at its start
    weightless: tuple[str, ...] = ()  # why the inertia of its links is not known, if it is not
    notes: tuple[str, ...] = ()  # remarks on what is read otherwise than its file says
    oddities: tuple[Oddity, ...] = ()  # implausible numbers in its file

    @property
    def n(self) -> int:
        """Number of free joints."""
        return len(self.joints)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the free joints, root to tip."""
        return tuple(joint.name for joint in self.joints)

    def frames(self, positions: Sequence[float] | Array) -> tuple[Pose, ...]:
        """Root, joints and tip in the world at joint positions, rad or m."""
        frames = [self.base]
        for joint, position in zip(self.joints, positions, strict=True):
            frames.append(frames[-1] @ joint.at(float(position)))
        return (*frames, frames[-1] @ self.tip)

    @property
    def fingerprint(self) -> bytes:
        """Equal for arms that move alike, wherever they stand and whatever they hold."""
        parts: list[object] = [self.tip.position.tobytes(), self.tip.quaternion.tobytes()]
        for joint in self.joints:
            place, body = joint.placement, joint.body
            arrays = (joint.axis, place.position, place.rotation, body.com, body.inertia)
            parts += [joint.kind, body.mass, joint.armature, *(a.tobytes() for a in arrays)]
        return repr(parts).encode()

    def tip_at(self, positions: Sequence[float] | Array) -> Pose:
        """T_world_tip at joint positions, rad or m."""
        return self.frames(positions)[-1]

    @property
    def lower(self) -> Array:
        """Lowest joint positions, −inf where unlimited, (n,)."""
        return np.array([joint.lower for joint in self.joints])

    @property
    def upper(self) -> Array:
        """Highest joint positions, inf where unlimited, (n,)."""
        return np.array([joint.upper for joint in self.joints])


def finite_range(lower: Array, upper: Array) -> tuple[Array, Array]:
    """Bounds of joints, (n,) each, one turn apart where a limit is missing."""
    low = np.where(
        np.isfinite(lower), lower, np.where(np.isfinite(upper), upper - 2 * np.pi, -np.pi)
    )
    return low, np.where(np.isfinite(upper), upper, low + 2 * np.pi)


def freed(spec: ArmSpec) -> tuple[str, ...]:
    """Those of an arm's base and grasp that its ``freedom`` lets move."""
    return tuple(what for what in ("base", "grasp") if getattr(spec.freedom, what).ranges)


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
