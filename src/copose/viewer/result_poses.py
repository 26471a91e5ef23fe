"""Poses of a result's object, bases and grasps."""

from __future__ import annotations

from copose.poses import Pose
from copose.results import PlanarPlace, Posture
from copose.results.posture import SpatialFrame


def object_pose(posture: Posture) -> Pose:
    """The pose of the object in the world, T_world_object."""
    place = posture.object
    if isinstance(place, PlanarPlace):
        return _planar(place)
    return Pose.from_quaternion(place.position, place.quaternion)


def frame_pose(frame: SpatialFrame | PlanarPlace) -> Pose:
    """The pose of a base or a grasp."""
    if isinstance(frame, PlanarPlace):
        return _planar(frame)
    return Pose.from_rpy(frame.position, frame.rpy)


def _planar(place: PlanarPlace) -> Pose:
    return Pose.from_rpy((*place.position, 0.0), (0.0, 0.0, place.angle))
