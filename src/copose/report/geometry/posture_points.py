"""Points and surfaces of arms and object in a posture."""

from __future__ import annotations

import numpy as np

from copose.poses import Array
from copose.report.geometry.free_ranges import object_axes
from copose.report.geometry.shapes import faces, outline
from copose.report.panels import Drawn
from copose.results import PlanarPlace, Posture


def spatial_points(posture: Posture, solution: Drawn) -> Array:
    """Points of arms and object in space, (k, 3)."""
    points = [np.array([*arm.skeleton, arm.grasp]) for arm in posture.arms.values()]
    return np.vstack([*points, object_points(posture, solution)])


def object_points(posture: Posture, solution: Drawn) -> Array:
    """The object's corners and its centre of mass in space, (k, 3)."""
    return np.vstack([*object_faces(posture, solution), posture.object.position])


def object_faces(posture: Posture, solution: Drawn) -> list[Array]:
    """The object's surface as polygons in the world; none where it has no shape."""
    shape = solution.problem.shape
    if shape is None:
        return []
    return faces(shape, posture.object.position, object_axes(posture))


def planar_points(posture: Posture, solution: Drawn) -> Array:
    """Points of arms and object in the plane, (k, 2)."""
    points = [np.array([*arm.skeleton, arm.grasp])[:, :2] for arm in posture.arms.values()]
    rim = object_outline(posture, solution)
    return np.vstack([*points, *([] if rim is None else [rim]), posture.object.position])


def object_outline(posture: Posture, solution: Drawn) -> Array | None:
    """The object's outline in the plane, (k, 2); None where it has no shape."""
    shape, place = solution.problem.shape, posture.object
    if shape is None or not isinstance(place, PlanarPlace):
        return None
    return outline(shape, place.position, place.angle)
