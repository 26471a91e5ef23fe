"""Convex hulls of points as faces and edges."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from copose.poses import Array

if TYPE_CHECKING:
    from scipy.spatial import ConvexHull


@dataclass(frozen=True, eq=False)
class Hull:
    """The convex hull of points in space."""

    faces: tuple[Array, ...]  # corners of each, in order, (k, 3)
    normals: Array  # unit, outwards, (f, 3)
    edges: Array  # ends of each, (e, 2, 3)
    sides: Array  # the two faces that meet in it, (e, 2)

    def outline(self, view: Array) -> Array:
        """Corners, in order, of the outline seen from afar; view: the picture's axes, (2, 3)."""
        points = np.vstack(self.faces)
        return np.asarray(points[_even_hull(points @ view.T)[0].vertices])

    @classmethod
    def of(cls, points: Array) -> Hull | None:
        """The hull of points, (k, 3); None of points in a plane."""
        # Slow to import, and planar pictures need none of it.
        from scipy.spatial import QhullError

        if len(points) < 4:
            return None
        try:
            hull, even = _even_hull(points)
        except QhullError:
            return None
        # Triangles lie in one face where their normals and distances agree to seven digits.
        planes, of_plane = np.unique(np.round(hull.equations, 7), axis=0, return_inverse=True)
        normals = planes[:, :3] @ even.T
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        borders: dict[tuple[int, int], list[int]] = defaultdict(list)
        for triangle, plane in zip(hull.simplices, of_plane.ravel(), strict=True):
            for pair in combinations(sorted(triangle.tolist()), 2):
                borders[pair].append(int(plane))
        edges = {pair: (s[0], s[-1]) for pair, s in borders.items() if s[0] != s[-1]}
        corners: dict[int, set[int]] = defaultdict(set)
        for pair, sides in edges.items():
            for side in sides:
                corners[side].update(pair)
        faces = tuple(
            _around(points[sorted(corners[k])], normal) for k, normal in enumerate(normals)
        )
        return cls(faces, normals, points[np.array(list(edges))], np.array(list(edges.values())))


def _even_hull(points: Array) -> tuple[ConvexHull, Array]:
    """The hull of points, (k, d), in coordinates in which no direction is thin, and the map there.

    Raises:
        QhullError: the points are flat.
    """
    from scipy.spatial import ConvexHull, QhullError

    offset = points - points.mean(axis=0)
    _, extents, rows = np.linalg.svd(offset, full_matrices=False)
    if extents[-1] <= 1e-12 * extents[0]:
        raise QhullError("flat")
    even = rows.T / extents
    return ConvexHull(offset @ even), even


def _around(corners: Array, normal: Array) -> Array:
    """Corners of a face in order."""
    arms = corners - corners.mean(axis=0)
    first = arms[0] / np.linalg.norm(arms[0])
    angle = np.arctan2(arms @ np.cross(normal, first), arms @ first)
    return np.asarray(corners[np.argsort(angle)])
