"""Surfaces of triangles: their convex hulls, and what they enclose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np

from copose.poses import Array, Indices, frozen_array


@dataclass(frozen=True)
class HullOptions:
    """Limits within which the convex hull of a surface stands in for it."""

    deepest: float = 2e-3  # m, depth of the surface below its hull, beyond which it is asked itself
    products: int = 30_000_000  # triangles times facets, beyond which that depth is not computed
    corners: int = 20_000  # of a hull; one with more gives way to a box
    neighbours: int = 255  # of a corner that coal can number; a flat face may be cut into a fan
    batch: int = 256  # triangles whose depths are computed at once
    rounding: float = 1e-9  # m, by which a box round a flat surface is larger


@dataclass(frozen=True, eq=False)
class Mesh:
    """A surface of triangles, as coal has read it."""

    coal: Any  # the surface with its tree of bounding volumes
    options: HullOptions = HullOptions()  # when its hull stands in for it
    kind: ClassVar[Literal["mesh"]] = "mesh"  # tells it from primitives

    @cached_property
    def vertices(self) -> Array:
        """Corners, m, (v, 3)."""
        return frozen_array(self.coal.vertices())

    @cached_property
    def triangles(self) -> Indices:
        """Corners of each triangle, by number, (t, 3)."""
        faces = (self.coal.tri_indices(i) for i in range(self.coal.num_tris))
        return np.array([[face[0], face[1], face[2]] for face in faces], dtype=np.intp)

    @cached_property
    def bound(self) -> Any:
        """The convex hull of the surface for coal; a box round it where it is flat, or where the
        hull has very many corners.
        """
        import coal

        corners, faces, _ = self._hull
        points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
        points.extend(list(corners))
        triangles.extend([coal.Triangle(*face) for face in faces.tolist()])
        return coal.Convex(points, triangles)

    @property
    def round(self) -> bool:
        """False: only primitives are all within a radius of a segment."""
        return False

    @property
    def hollow(self) -> bool:
        """True: to coal a mesh is its surface alone."""
        return True

    @cached_property
    def below(self) -> float:
        """Largest distance of a point of the bound from what the surface encloses, m; infinite
        where that is much, or not known.

        A closed surface whose points are all within some depth of the hull has a point within that
        depth of every point of it. The depth below a facet is linear, so no point of a triangle is
        deeper below the hull than the deepest of its corners below any one facet.
        """
        _, _, facets = self._hull
        if not len(facets) or len(facets) * self.coal.num_tris > self.options.products:
            return np.inf
        depths = -(self.vertices @ facets[:, :3].T + facets[:, 3])
        deepest = 0.0
        for first in range(0, len(self.triangles), self.options.batch):
            corners = depths[self.triangles[first : first + self.options.batch]]
            deepest = max(deepest, float(corners.max(axis=1).min(axis=1).max()))
            if deepest > self.options.deepest:
                return np.inf
        middle = self.vertices.mean(axis=0)
        inside = float(-(facets[:, :3] @ middle + facets[:, 3]).max())
        return deepest if inside > deepest and self.encloses(middle) else np.inf

    @cached_property
    def _hull(self) -> tuple[Array, Indices, Array]:
        """Corners and triangles of the bound, wound outwards, and n and −d of the hull's facets
        {x : n·x ≤ d}, none where the bound is a box.
        """
        from scipy.spatial import ConvexHull, QhullError

        options = self.options
        try:
            hull = ConvexHull(self.vertices)
        except (QhullError, ValueError):
            return self._box
        crowded = np.bincount(hull.simplices.ravel()).max() > options.neighbours
        if crowded or len(hull.vertices) > options.corners:
            return self._box
        number = np.full(len(self.vertices), -1)
        number[hull.vertices] = np.arange(len(hull.vertices))
        faces, x = hull.simplices.copy(), self.vertices
        a, b, c = np.swapaxes(x[faces], 0, 1)
        inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
        faces[inward] = faces[inward][:, [0, 2, 1]]
        facets, corners = np.unique(hull.equations.round(12), axis=0), x[hull.vertices]
        # Rounding must leave no point of the surface outside.
        for planes in np.array_split(facets, 1 + facets.size * len(corners) // options.batch**2):
            planes[:, 3] = -(corners @ planes[:, :3].T).max(axis=0) - options.rounding
        return corners, number[faces], facets

    @property
    def _box(self) -> tuple[Array, Indices, Array]:
        """Corners and triangles of the box round the surface, and no facets."""
        (low, high), rounding = self.extent, self.options.rounding
        ends = np.column_stack([low - rounding, high + rounding])
        corners = np.stack(np.meshgrid(*ends, indexing="ij"), axis=-1).reshape(-1, 3)
        sides = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4],
                          [1, 5, 7, 3]])  # fmt: skip
        faces = np.vstack([sides[:, [0, 1, 2]], sides[:, [0, 2, 3]]])
        return corners, faces, np.zeros((0, 4))

    @property
    def hull(self) -> tuple[Array, float]:
        """Points, (n, 3), and a distance: all within it of their convex hull holds the surface."""
        return self._hull[0], 0.0

    def support(self, directions: Array) -> Array:
        """The surface's reach in unit directions, (m, 3); m, (m,)."""
        return np.asarray((self._hull[0] @ directions.T).max(axis=0))

    @property
    def witness(self) -> Array:
        """A point of the surface."""
        point: Array = self.vertices[0]
        return point

    @property
    def fingerprint(self) -> bytes:
        """Equal for surfaces that look alike."""
        return self.vertices.tobytes() + self.triangles.tobytes()

    @cached_property
    def extent(self) -> tuple[Array, Array]:
        """Lowest and highest coordinates, (3,) each."""
        return self.vertices.min(axis=0), self.vertices.max(axis=0)

    def encloses(self, point: Array) -> bool:
        """True where the surface winds round a point, (3,), by the sum of its solid angles.

        A gap in the surface does little harm to the sum.
        """
        low, high = self.extent
        if np.any(point < low) or np.any(point > high):
            return False
        a, b, c = np.swapaxes(self.vertices[self.triangles] - point, 0, 1)
        la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
        above = np.einsum("ij,ij->i", a, np.cross(b, c))
        below = (
            la * lb * lc
            + np.einsum("ij,ij->i", a, b) * lc
            + np.einsum("ij,ij->i", b, c) * la
            + np.einsum("ij,ij->i", c, a) * lb
        )
        return bool(abs(np.arctan2(above, below).sum()) > np.pi)


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
    """Corners and triangles of a polyhedron that holds the unit ball, wound outwards: those of an
    octahedron, divided by four so often; by 3 there are 512.
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
