"""Surfaces of triangles made from their corners, and polyhedra that hold ellipsoids."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from copose.collision.shapes.meshes import Mesh
from copose.poses import Array, Indices


def mesh_of(corners: Array, triangles: Indices) -> Mesh:
    """The surface of triangles, (t, 3), by numbers of their corners, m, (v, 3)."""
    import coal

    surface = coal.BVHModelOBBRSS()
    surface.beginModel(len(triangles), len(corners))
    surface.addVertices(corners)
    surface.addTriangles(triangles)
    surface.endModel()
    return Mesh(surface)


def ellipsoid_mesh(axes: Array) -> Mesh:
    """A polyhedron that holds an ellipsoid, by its semi-axes, m, (3,)."""
    corners, triangles = _ball()
    return mesh_of(corners * axes, triangles)


def _ball(quartered: int = 3) -> tuple[Array, Indices]:
    """Corners and triangles of a polyhedron that holds the unit ball, wound outwards.

    Args:
        quartered: how often the triangles of an octahedron are divided by four; by 3 there are 512.
    """
    corners = [tuple(row) for row in np.vstack([np.eye(3), -np.eye(3)])]
    number = {corner: i for i, corner in enumerate(corners)}
    faces: list[Sequence[int]] = [
        (0, 1, 2), (1, 3, 2), (3, 4, 2), (4, 0, 2), (1, 0, 5), (3, 1, 5), (4, 3, 5), (0, 4, 5)
    ]  # fmt: skip

    def between(i: int, j: int) -> int:
        middle = np.add(corners[i], corners[j])
        corner = tuple(middle / np.linalg.norm(middle))
        if corner not in number:
            number[corner] = len(corners)
            corners.append(corner)
        return number[corner]

    for _ in range(quartered):
        split: list[Sequence[int]] = []
        for i, j, k in faces:
            ij, jk, ki = between(i, j), between(j, k), between(k, i)
            split += [(i, ij, ki), (ij, j, jk), (ki, jk, k), (ij, jk, ki)]
        faces = split
    points, triangles = np.array(corners), np.array(faces, dtype=np.intp)
    a, b, c = np.swapaxes(points[triangles], 0, 1)
    normal = np.cross(b - a, c - a)
    depth = np.einsum("ij,ij->i", a, normal) / np.linalg.norm(normal, axis=1)
    return points / depth.min(), triangles
