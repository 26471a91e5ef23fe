"""Shapes, obstacles, arms, objects and free ranges as polygons, points and boxes in the world."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any

import numpy as np

from copose.poses import Array, rotation_rows
from copose.problem import CapsuleShape, Obstacle, PlanarObstacle, Shape
from copose.report.panels import Drawn, Panel, case_of
from copose.results import FreeRecord, PlanarPlace, Posture


def faces(shape: Shape | CapsuleShape, position: Sequence[float], rotation: Array) -> list[Array]:
    """The surface of a shape in space, faces of (k, 3) corners."""
    return [np.array(position) + face @ rotation.T for face in _FACES[shape.kind](shape)]


def outline(shape: Shape, position: Sequence[float], angle: float) -> Array:
    """The corners of a shape in the plane, (k, 2)."""
    return np.asarray(np.array(position) + _OUTLINES[shape.kind](shape, angle))


def turn(angle: float) -> Array:
    """The rotation of the plane by an angle, (2, 2)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def cut(corners: Array, low: Array, high: Array) -> Array:
    """The part of a flat convex polygon, (k, d), that lies in a box; no corners where none does."""
    for axis in range(len(low)):
        for sign, bound in ((1.0, high[axis]), (-1.0, -low[axis])):
            beyond = sign * corners[:, axis] - bound
            kept = []
            for k, depth in enumerate(beyond):
                last = beyond[k - 1]
                if last * depth < 0:
                    share = last / (last - depth)
                    kept.append(corners[k - 1] + share * (corners[k] - corners[k - 1]))
                if depth <= 0:
                    kept.append(corners[k])
            corners = np.array(kept).reshape(-1, len(low))
    return corners


def _tube(radii: Array, heights: Array) -> list[Array]:
    """A surface of revolution about z, as quadrilaterals."""
    angle = np.linspace(0, 2 * np.pi, 17)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    around = []
    for (r0, r1), (z0, z1) in zip(pairwise(radii), pairwise(heights), strict=True):
        for a, b in pairwise(ring):
            around.append(np.array([[*a * r0, z0], [*b * r0, z0], [*b * r1, z1], [*a * r1, z1]]))
    return around


def _box(shape: Any) -> list[Array]:
    """The six faces of a box."""
    boxed, half = [], np.array(shape.size) / 2
    for axis in range(3):
        for sign in (-1.0, 1.0):
            corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
            boxed.append(np.insert(corners, axis, sign, axis=1) * half)
    return boxed


def _sphere(shape: Any) -> list[Array]:
    polar = np.linspace(0, np.pi, 7)
    return _tube(shape.radius * np.sin(polar), shape.radius * np.cos(polar))


def _capsule(shape: Any) -> list[Array]:
    cap, length = np.linspace(0, np.pi / 2, 4), shape.length / 2
    radii, heights = shape.radius * np.sin(cap), length + shape.radius * np.cos(cap)
    return _tube(np.append(radii, radii[::-1]), np.append(heights, -heights[::-1]))


def _cylinder(shape: Any) -> list[Array]:
    radius, length = shape.radius, shape.length / 2
    return _tube(np.array([0.0, radius, radius, 0.0]), np.array([-1, -1, 1, 1]) * length)


def _rectangle(shape: Any, angle: float) -> Array:
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (np.array(shape.size[:2]) / 2)
    return np.asarray(corners @ turn(angle).T)


def _disk(shape: Any, angle: float) -> Array:
    around = np.linspace(0, 2 * np.pi, 90)
    return np.asarray(shape.radius * np.column_stack([np.cos(around), np.sin(around)]))


_FACES: dict[str, Callable[[Any], list[Array]]] = {
    "box": _box,
    "sphere": _sphere,
    "capsule": _capsule,
    "cylinder": _cylinder,
}
_OUTLINES: dict[str, Callable[[Any, float], Array]] = {"box": _rectangle, "disk": _disk}


def object_axes(posture: Posture) -> Array:
    """The rotation of the object, (d, d)."""
    place = posture.object
    if isinstance(place, PlanarPlace):
        return turn(place.angle)
    return np.array(rotation_rows(place.quaternion))


@dataclass(frozen=True, eq=False)
class DrawnObstacle:
    """The part of an obstacle that a picture shows."""

    name: str  # name of the obstacle
    faces: tuple[Array, ...]  # polygons in the world, (k, d) each; one in the plane
    round: bool  # whether the obstacle is round, so that edges between faces are not drawn

    @property
    def points(self) -> Array:
        """The corners, (k, d)."""
        return np.vstack(self.faces)


def near_obstacles(
    solution: Drawn, low: Array, high: Array, *, margin: float = 0.25
) -> list[DrawnObstacle]:
    """Obstacles near a scene; of those larger than it the parts that are near.

    Args:
        solution: the result, or the problem.
        low: least coordinates of arms and object, (d,).
        high: largest coordinates, (d,).
        margin: distance up to which large obstacles are drawn, as a share of the scene: a whole
            floor would dwarf what stands on it.
    """
    size = float((high - low).max())
    beyond = margin * size
    shown = []
    for obstacle in solution.problem.obstacles:
        whole = _obstacle_faces(obstacle)
        parts = [cut(face, low - beyond, high + beyond) for face in whole]
        near = tuple(part for part in parts if len(part))
        if near and float(np.ptp(np.vstack(whole), axis=0).max()) <= size:
            near = tuple(whole)
        if near:
            shown.append(DrawnObstacle(obstacle.name, near, obstacle.shape.kind != "box"))
    return shown


def _obstacle_faces(obstacle: Obstacle | PlanarObstacle) -> list[Array]:
    """An obstacle as polygons in the world."""
    if isinstance(obstacle, PlanarObstacle):
        return [outline(obstacle.shape, obstacle.position, obstacle.angle)]
    return faces(obstacle.shape, obstacle.position, obstacle.pose.rotation)


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


@dataclass(frozen=True, eq=False)
class Range:
    """The box of positions that something may take; flat along what is not free."""

    arm: str | None  # the arm of a base or grasp; None for the object
    what: str  # ``object``, ``base`` or ``grasp``
    edges: Array  # ends of each that has a length, in the world, (e, 2, d)


def ranges(panel: Panel) -> list[Range]:
    """The boxes around the file's positions in which a posture's free positions had to be."""
    posture = panel.posture
    case = f"{case_of(posture)}: " if case_of(posture) else ""
    center = np.array(posture.object.position)
    nothing, world = np.zeros(len(center)), np.eye(len(center))
    boxes = [Range(None, "object", _edges(panel, f"{case}object", center, nothing, world))]
    for arm, base in (posture.base or {}).items():
        position = np.array(base.position)
        boxes.append(Range(arm, "base", _edges(panel, f"{arm}.base", position, nothing, world)))
    axes = object_axes(posture)
    for arm, grasp in (posture.grasp or {}).items():
        position = np.array(grasp.position)
        boxes.append(Range(arm, "grasp", _edges(panel, f"{arm}.grasp", position, center, axes)))
    return [box for box in boxes if len(box.edges)]


def _offset(record: FreeRecord, panel: Panel) -> float | None:
    """The offset of a coordinate from the file's pose in a panel; None where it is not known."""
    earlier = (panel.solution.before, *(panel.solution.cases_before or ()))
    was = any(panel.posture is posture for posture in earlier)
    offset = record.before if was else record.after
    if offset is None and panel.misses and panel.solution.search is not None:
        # A search tells of what it misses at the file's pose, or as near to it as the range has it.
        return min(max(0.0, record.lower), record.upper)
    return offset


def _edges(panel: Panel, name: str, position: Array, origin: Array, axes: Array) -> Array:
    """The edges, (e, 2, d), of the box around a position, (d,), in a frame of the world."""
    records = {record.name: record for record in panel.solution.freedom}
    low, high = position.copy(), position.copy()
    for k, axis in zip(range(len(position)), "xyz", strict=False):
        record = records.get(f"{name}.{axis}")
        offset = None if record is None else _offset(record, panel)
        if record is not None and offset is not None:
            file = position[k] - offset
            low[k], high[k] = file + record.lower, file + record.upper
    return np.asarray(origin + _box_edges(low, high) @ axes.T)


def _box_edges(low: Array, high: Array) -> Array:
    """The edges of a box that have a length, each once, (e, 2, d)."""
    free, edges = [k for k in range(len(low)) if high[k] > low[k]], []
    for axis in free:
        other_axes = [k for k in free if k != axis]
        for corner in product(*((low[k], high[k]) for k in other_axes)):
            edge = np.array([low, low])
            edge[:, other_axes] = corner
            edge[1, axis] = high[axis]
            edges.append(edge)
    return np.array(edges).reshape(-1, 2, len(low))
