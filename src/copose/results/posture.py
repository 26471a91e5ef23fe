"""Postures: joint positions and what they are worth, as a result states them."""

from __future__ import annotations

import math
from typing import Any

from pydantic import model_serializer
from pydantic_core.core_schema import SerializerFunctionWrapHandler

from copose.poses import Array, Pose
from copose.results import arrays
from copose.results.records import (
    AccelerationRecord,
    CompanionRecord,
    EllipsoidRecord,
    ExactSetRecord,
    Finite,
    Matrix,
    Record,
    Vector,
    WrenchRecord,
    vector,
)


class SpatialPlace(Record):
    """Pose of the object's centre of mass: position, m, and unit quaternion [w, x, y, z]."""

    position: tuple[Finite, Finite, Finite]
    quaternion: tuple[Finite, Finite, Finite, Finite]


class PlanarPlace(Record):
    """Pose of the object's centre of mass in the plane."""

    position: tuple[Finite, Finite]
    angle: Finite


def place(pose: Pose, planar: bool) -> SpatialPlace | PlanarPlace:
    """A pose as a result states it."""
    if planar:
        angle = math.atan2(pose.rotation[1, 0], pose.rotation[0, 0])
        return PlanarPlace.model_validate({"position": vector(pose.position[:2]), "angle": angle})
    return SpatialPlace.model_validate(
        {"position": vector(pose.position), "quaternion": vector(pose.quaternion)}
    )


class SpatialFrame(Record):
    """A base in the world or a grasp in the object: position, m, and roll, pitch, yaw, rad."""

    position: tuple[Finite, Finite, Finite]
    rpy: tuple[Finite, Finite, Finite]


def frame(pose: Pose, planar: bool) -> SpatialFrame | PlanarPlace:
    """A base or a grasp as a problem file states it."""
    if planar:
        return PlanarPlace.model_validate(place(pose, planar).model_dump())
    return SpatialFrame.model_validate({"position": vector(pose.position), "rpy": vector(pose.rpy)})


class CollisionRecord(Record):
    """The smallest distance of what may not touch, m, and between which two it is."""

    distance: Finite
    pair: tuple[str, str]


class ArmRecord(Record):
    """One arm of a posture.

    Attributes:
        skeleton: root, joint origins and tip in the world, m.
        quaternions: of the same frames, [w, x, y, z].
        grasp: where the tip should be, m.
        ellipsoid: of the arm alone at its tip, by the same resolution and torque scaling.
    """

    skeleton: Matrix
    quaternions: Matrix
    grasp: Vector
    ellipsoid: EllipsoidRecord


class Posture(Record):
    """Joint positions and what they are worth.

    Of what torque limits allow a posture states what was asked for, `copose evaluate` all; null
    is what does not exist, and a key that nothing asked for is left out.

    Attributes:
        joints: rad or m, by arm.
        object: where the object is.
        closure_error: the larger of a tip's position error, m, and angle error, rad, by arm; in the
            linear spaces the position error.
        ellipsoid: of the system, at the object's centre of mass.
        log_volumes: by resolution, whichever is optimised.
        arms: each arm's own.
        payload: kg, the largest mass of the object that can be held with every joint at rest, or
            accelerated as the objective asks with the least-norm joint accelerations.
        static_torque: share of each joint's limit in the hold whose largest share is smallest.
        torque_shares: alike, of each extreme that is reported, by its name.
        residual_radius: of the largest ball of accelerations around rest.
        accelerations: the largest along directions.
        wrenches: of each extreme that is reported, by its name and by arm.
        joint_accelerations: rad/s² or m/s², alike, where joints are not at rest; of a residual
            radius those in the direction in which its ball touches the exact set's surface.
        exact_sets: linear and angular.
        companions: ellipsoids of velocities and forces, by name.
        base: where bases that may be moved are, by arm.
        grasp: where tips are in the object frame, of grasps that may be moved.
        collision: on the original geometry.
    """

    joints: dict[str, Vector]
    object: SpatialPlace | PlanarPlace
    closure_error: dict[str, Finite]
    ellipsoid: EllipsoidRecord
    log_volumes: dict[str, Finite | None]
    arms: dict[str, ArmRecord]
    payload: Finite | None = None
    static_torque: dict[str, Vector] | None = None
    torque_shares: dict[str, dict[str, Vector]] | None = None
    residual_radius: Finite | None = None
    accelerations: tuple[AccelerationRecord, ...] | None = None
    wrenches: dict[str, dict[str, WrenchRecord]] | None = None
    joint_accelerations: dict[str, dict[str, Vector]] | None = None
    exact_sets: dict[str, ExactSetRecord] | None = None
    companions: dict[str, CompanionRecord] | None = None
    base: dict[str, SpatialFrame | PlanarPlace] | None = None
    grasp: dict[str, SpatialFrame | PlanarPlace] | None = None
    collision: CollisionRecord | None = None

    @property
    def q(self) -> Array:
        """The positions of all arms' joints, rad or m, (N,)."""
        return arrays.stacked(self.joints)

    @model_serializer(mode="wrap")
    def _as_asked(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        data: dict[str, Any] = handler(self)
        return {key: value for key, value in data.items() if key in self.model_fields_set}


class CasePosture(Posture):
    """The posture of one of the file's cases.

    Attributes:
        name: the case's.
        weight: how much it counts.
        objective: its own value.
    """

    name: str
    weight: Finite
    objective: Finite | None
