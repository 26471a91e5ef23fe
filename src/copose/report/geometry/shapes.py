"""Shapes as polygons in the world."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from copose.poses import Array
from copose.problem import CapsuleShape, Shape


def faces(shape: Shape | CapsuleShape, position: Sequence[float], rotation: Array) -> list[Array]:
    """The surface of a shape in space, faces of (k, 3) corners."""
    return [np.array(position) + face @ rotation.T for face in _faces(shape)]


def outline(shape: Shape, position: Sequence[float], angle: float) -> Array:
    """The corners of a shape in the plane, (k, 2)."""
    center = np.array(position)
    if shape.kind == "disk":
        around = np.linspace(0, 2 * np.pi, 90)
        return np.asarray(center + shape.radius * np.column_stack([np.cos(around), np.sin(around)]))
    assert shape.kind == "box", "the plane has disks and boxes"
    half = np.array(shape.size[:2]) / 2
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    return np.asarray(center + corners @ turn(angle).T)


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


def _faces(shape: Shape | CapsuleShape) -> list[Array]:
    """The surface of a shape in its own frame."""
    if shape.kind == "box":
        return _box(np.array(shape.size) / 2)
    if shape.kind == "sphere":
        polar = np.linspace(0, np.pi, 7)
        return _tube(shape.radius * np.sin(polar), shape.radius * np.cos(polar))
    assert shape.kind != "disk", "disks are of the plane"
    length = shape.length / 2
    if shape.kind == "capsule":
        cap = np.linspace(0, np.pi / 2, 4)
        radii, heights = shape.radius * np.sin(cap), length + shape.radius * np.cos(cap)
        return _tube(np.append(radii, radii[::-1]), np.append(heights, -heights[::-1]))
    return _tube(
        np.array([0.0, shape.radius, shape.radius, 0.0]),
        np.array([-length, -length, length, length]),
    )


def _box(half: Array) -> list[Array]:
    """The six faces of a box, by half of its size, (3,)."""
    boxed = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
            boxed.append(np.insert(corners, axis, sign, axis=1) * half)
    return boxed


def _tube(radii: Array, heights: Array) -> list[Array]:
    """A surface of revolution about z, as quadrilaterals."""
    angle = np.linspace(0, 2 * np.pi, 17)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    around = []
    for (r0, r1), (z0, z1) in zip(pairwise(radii), pairwise(heights), strict=True):
        for a, b in pairwise(ring):
            around.append(np.array([[*a * r0, z0], [*b * r0, z0], [*b * r1, z1], [*a * r1, z1]]))
    return around
