"""Shapes of a problem file as triangles, and places of a result as poses."""

from __future__ import annotations

import numpy as np

from copose.poses import Array, Pose
from copose.problem import CapsuleShape, Shape
from copose.results import PlanarPlace, Posture
from copose.results.solution import SpatialFrame
from copose.viewer.ellipsoids import circle
from copose.viewer.solids import Triangles, box, capsule, cylinder

# Thickness of planar bodies, m.
SLAB = 0.02
# Corners of a disk.
_ROUND = 72


def body(shape: Shape | CapsuleShape) -> Triangles:
    """A shape about its own origin; one of the plane is a slab."""
    if shape.kind == "box":
        return box(np.array([*shape.size, SLAB][:3]))
    if shape.kind == "disk":
        return cylinder(shape.radius, SLAB, _ROUND)
    if shape.kind == "sphere":
        return capsule(shape.radius, 0.0)
    made = cylinder if shape.kind == "cylinder" else capsule
    return made(shape.radius, shape.length)


def edges(shape: Shape | CapsuleShape) -> Array:
    """Edges of a box, or of a slab's upper side, (e, 2, 3); none of other shapes."""
    if shape.kind == "disk":
        return circle() * [shape.radius, shape.radius, 0.0] + [0, 0, SLAB / 2]
    if shape.kind != "box":
        return np.zeros((0, 2, 3))
    half = np.array([*shape.size, SLAB][:3]) / 2
    ends = [
        [np.insert([a, b], axis, end) for end in (-1, 1)]
        for axis in range(3) for a in (-1, 1) for b in (-1, 1)
    ]  # fmt: skip
    return np.array(ends) * half


def object_pose(posture: Posture) -> Pose:
    """T_world_object."""
    place = posture.object
    if isinstance(place, PlanarPlace):
        return _planar(place)
    return Pose.from_quaternion(place.position, place.quaternion)


def frame_pose(frame: SpatialFrame | PlanarPlace) -> Pose:
    """A base or a grasp as a pose."""
    if isinstance(frame, PlanarPlace):
        return _planar(frame)
    return Pose.from_rpy(frame.position, frame.rpy)


def _planar(place: PlanarPlace) -> Pose:
    return Pose.from_rpy((*place.position, 0.0), (0.0, 0.0, place.angle))
