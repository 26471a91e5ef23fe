"""An arm as plain numbers: what every later room needs to know of a robot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from copose.errors import InputError, shown
from copose.poses import Array, Pose, frozen_array, rotation_rows
from copose.problem import ArmSpec

# Position limits from here on stand for none.
_NO_LIMIT = 1e6
_PER_JOINT = (
    "start", "torque_limits", "position_limits", "velocity_limits", "acceleration_limits",
    "armature",
)  # fmt: skip


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


def motion(kind: str, axis: Array, position: float) -> Pose:
    """How far a joint has gone at a position: along its unit axis, m, or about it, rad."""
    if kind == "prismatic":
        return Pose.from_rpy(axis * position)
    quaternion = [math.cos(position / 2), *(axis * math.sin(position / 2))]
    return Pose.make(np.zeros(3), rotation_rows(quaternion), quaternion)


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint of one degree of freedom and the body it moves.

    Attributes:
        name: as in the robot's file; ``joint1``, ``joint2``, … for a planar arm.
        kind: revolute (rad) or prismatic (m).
        axis: unit axis in the joint's frame.
        placement: joint frame at zero in the frame of the joint before it (the first: in the root).
        body: everything rigidly attached, in the joint's frame.
        lower: lowest position, −inf where there is none; ``upper`` alike.
        velocity: speed limit, inf where there is none.
        acceleration: limit of its acceleration, inf where there is none.
        effort: torque or force limit, inf where there is none.
        armature: reflected rotor inertia, added to M's diagonal.
    """

    name: str
    kind: Literal["revolute", "prismatic"]
    axis: Array
    placement: Pose
    body: Body
    lower: float = -np.inf
    upper: float = np.inf
    velocity: float = np.inf
    acceleration: float = np.inf
    effort: float = np.inf
    armature: float = 0.0

    def at(self, position: float) -> Pose:
        """T_before_joint at a position, rad or m."""
        return self.placement @ motion(self.kind, self.axis, position)


@dataclass(frozen=True)
class LockedJoint:
    """A movable joint of the arm, or of what it carries, that is held still."""

    name: str
    position: float
    lower: float
    upper: float


@dataclass(frozen=True)
class Oddity:
    """A number of a robot's file that no robot has.

    Attributes:
        about: what it is a number of.
        text: a sentence that names the link or the joint.
    """

    about: Literal["inertia", "effort", "speed"]
    text: str


@dataclass(frozen=True, eq=False)
class Arm:
    """A serial chain on a fixed base, and how it holds the object.

    Attributes:
        name: as in the problem file.
        model: where the numbers come from, for the reader: a robot's file name, ``planar links``.
        joints: the free joints, root to tip.
        base: T_world_root.
        tip: tip frame in the last joint's frame.
        grasp: T_object_tip.
        start: joint positions before, or None.
        locked: movable joints held still, on the chain or carried by it.
        geared: whether the rotors' inertia is known.
        free: which of ``base`` and ``grasp`` may be moved.
        fixed: whether it is held at its start.
        weightless: why the inertia of its links is not known, if it is not.
        notes: what its file says that is read otherwise.
        oddities: numbers of its file that no robot has.
    """

    name: str
    model: str
    joints: tuple[Joint, ...]
    base: Pose
    tip: Pose
    grasp: Pose
    start: Array | None = None
    locked: tuple[LockedJoint, ...] = ()
    geared: bool = True
    free: tuple[str, ...] = ()
    fixed: bool = False
    weightless: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    oddities: tuple[Oddity, ...] = ()

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
        found = [self.base]
        for joint, position in zip(self.joints, positions, strict=True):
            found.append(found[-1] @ joint.at(float(position)))
        return (*found, found[-1] @ self.tip)

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
        """Lowest joint positions, −inf where unlimited, shape (n,)."""
        return np.array([joint.lower for joint in self.joints])

    @property
    def upper(self) -> Array:
        """Highest joint positions, inf where unlimited, shape (n,)."""
        return np.array([joint.upper for joint in self.joints])


def finite_range(lower: Array, upper: Array) -> tuple[Array, Array]:
    """Bounds with one turn in the place of a missing limit, from the other limit or about zero."""
    low = np.where(
        np.isfinite(lower), lower, np.where(np.isfinite(upper), upper - 2 * np.pi, -np.pi)
    )
    return low, np.where(np.isfinite(upper), upper, low + 2 * np.pi)


class Doubts:
    """What the limits of an arm's joints are read as, where that is not what its file says."""

    def __init__(self) -> None:
        """Nothing yet."""
        self._joints: dict[str, list[str]] = {}

    def positions(self, joint: str, limits: tuple[float, float]) -> tuple[float, float]:
        """Limits of a joint's position; those of 1e6 and more are none."""
        if any(_NO_LIMIT <= abs(limit) < np.inf for limit in limits):
            self.note("position limits of 1e6 and more count as none", joint)
        lower, upper = (limit if abs(limit) < _NO_LIMIT else np.inf for limit in limits)
        return -lower if lower == np.inf else lower, upper

    def positive(self, what: str, joint: str, limit: float | None, fault: str = "") -> float:
        """A limit that only a positive number is; infinite where it is none, or not given.

        Args:
            what: it limits, in the plural.
            joint: its name.
            limit: as written.
            fault: why it cannot be read, if it cannot.
        """
        if limit is not None and limit > 0:
            return limit
        if limit is not None or fault:
            shown = "no number" if limit is None else f"{limit:g}"
            self.note(f"limits of {what} that are not above zero count as not given", joint, shown)
        return np.inf

    def told(self, arm: str) -> tuple[str, ...]:
        """A sentence on each kind, with the joints."""
        return tuple(
            f"arm {arm!r}: {what}: {', '.join(joints)}" for what, joints in self._joints.items()
        )

    def note(self, what: str, joint: str, value: str = "") -> None:
        """What something is read as, of a joint, or of a link."""
        self._joints.setdefault(what, []).append(f"{joint} ({value})" if value else joint)


def check_lengths(spec: ArmSpec, names: tuple[str, ...], key: str) -> None:
    """Refuse a per-joint array of the wrong length, naming the joints it is for."""
    for field_name in _PER_JOINT:
        values = getattr(spec, field_name)
        if values is not None and len(values) != len(names):
            raise InputError(
                f"has {len(values)} entries; {len(names)} are needed, for {', '.join(names)}",
                key=f"{key}.{field_name}",
            )


def freed(spec: ArmSpec) -> tuple[str, ...]:
    """Which of an arm's base and grasp its ``freedom`` lets move."""
    return tuple(what for what in ("base", "grasp") if getattr(spec.freedom, what).ranges)


def start_within_limits(spec: ArmSpec, joints: tuple[Joint, ...], key: str) -> Array | None:
    """The start, clipped where it misses a limit by rounding only."""
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
