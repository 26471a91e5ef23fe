"""Bodies that may touch: the shapes that problem files and URDFs name, and meshes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, TypeAlias

import numpy as np

from copose.collision.carriers import Carrier
from copose.poses import Array, Indices, Pose, frozen_array

# A planar shape is a slab this thick to the exact distances: what is nearest lies in the plane.
_THICKNESS = 1.0
# Sides of the prism round a cylinder.
_SIDES = 24
# A surface that is farther below its hull is asked itself, and so is one whose triangles times the
# hull's facets are more; a hull with more corners is replaced by a box.
_DEEP, _MANY, _CORNERS = 2e-3, 30_000_000, 20_000
# Of one corner coal knows so many neighbours; a large flat face may be cut into a fan.
_NEIGHBOURS = 255
_AT_ONCE = 256
# What the box round a flat surface is larger, m.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Primitive:
    """A shape by its measures, m, centred in its frame.

    Attributes:
        kind: a box, a sphere, a cylinder along z, or all within a radius of a segment along z.
        size: edge lengths; radius; radius and length; radius and length of the segment.
        flat: a planar shape: a rectangle is a box of two edges, a disk a sphere.
    """

    kind: Literal["box", "sphere", "cylinder", "capsule"]
    size: tuple[float, ...]
    flat: bool = False

    @cached_property
    def coal(self) -> Any:
        """The same for coal."""
        import coal

        if self.kind == "box":
            return coal.Box(*self.size, _THICKNESS) if self.flat else coal.Box(*self.size)
        if self.kind == "sphere":
            return coal.Cylinder(*self.size, _THICKNESS) if self.flat else coal.Sphere(*self.size)
        return (coal.Cylinder if self.kind == "cylinder" else coal.Capsule)(*self.size)

    @property
    def bound(self) -> Any:
        """A convex shape for coal that contains it: itself."""
        return self.coal

    @property
    def below(self) -> float:
        """How far points of the bound are from it at most, m."""
        return 0.0

    @property
    def round(self) -> bool:
        """True for a sphere and a capsule: all within a distance of a segment, see `hull`."""
        return self.kind in ("sphere", "capsule")

    @cached_property
    def hull(self) -> tuple[Array, float]:
        """Points (n, 3) and a distance: all within it of their convex hull holds the shape."""
        if self.kind in ("box", "cylinder"):
            return self.corners, 0.0
        radius, *length = self.size
        end = np.array([0.0, 0.0, sum(length) / 2])
        return np.array([-end, end]), radius

    def support(self, directions: Array) -> Array:
        """How far the shape reaches in unit directions, (m, 3); (m,)."""
        x, y, z = np.abs(directions.T)
        if self.kind == "box":
            return np.asarray((np.column_stack([x, y, z][: len(self.size)]) @ self.size) / 2)
        radius, *length = self.size
        along = z * sum(length) / 2
        return np.asarray(along + (np.hypot(x, y) if self.kind == "cylinder" else 1.0) * radius)

    @property
    def witness(self) -> Array:
        """A point of the shape."""
        return np.zeros(3)

    @property
    def corners(self) -> Array:
        """Points whose hull contains the shape: a box's corners, a prism's round a cylinder."""
        if self.kind == "box":
            x, y, z = (*self.size, 0.0)[:3]
            ends = [(-x, x), (-y, y), (-z, z) if not self.flat else (0.0,)]
            return np.stack(np.meshgrid(*ends), axis=-1).reshape(-1, 3) / 2
        radius, length = self.size
        angles = np.arange(_SIDES) * 2 * np.pi / _SIDES
        rim = radius / np.cos(np.pi / _SIDES) * np.column_stack([np.cos(angles), np.sin(angles)])
        return np.vstack(
            [np.column_stack([rim, np.full(_SIDES, z)]) for z in (-length / 2, length / 2)]
        )


@dataclass(frozen=True, eq=False)
class Mesh:
    """A surface of triangles, as coal has read it.

    Attributes:
        coal: the surface with its tree of bounding volumes.
    """

    coal: Any

    @cached_property
    def vertices(self) -> Array:
        """Corners, m, shape (v, 3)."""
        return frozen_array(self.coal.vertices())

    @cached_property
    def triangles(self) -> Indices:
        """Corners of each triangle, by number, shape (t, 3)."""
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
        """A surface is not."""
        return False

    @cached_property
    def below(self) -> float:
        """How far points of the bound are from what the surface encloses at most, m; infinite where
        that is much, or not known.

        A closed surface whose points are all within some depth of the hull has a point within that
        depth of every point of it. The depth below a facet is linear, so no point of a triangle is
        deeper below the hull than the deepest of its corners below any one facet.
        """
        _, _, facets = self._hull
        if not len(facets) or len(facets) * self.coal.num_tris > _MANY:
            return np.inf
        depths = -(self.vertices @ facets[:, :3].T + facets[:, 3])
        deepest = 0.0
        for first in range(0, len(self.triangles), _AT_ONCE):
            corners = depths[self.triangles[first : first + _AT_ONCE]]
            deepest = max(deepest, float(corners.max(axis=1).min(axis=1).max()))
            if deepest > _DEEP:
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

        try:
            hull = ConvexHull(self.vertices)
        except (QhullError, ValueError):
            return self._box
        many = np.bincount(hull.simplices.ravel()).max() > _NEIGHBOURS
        if many or len(hull.vertices) > _CORNERS:
            return self._box
        number = np.full(len(self.vertices), -1)
        number[hull.vertices] = np.arange(len(hull.vertices))
        faces, x = hull.simplices.copy(), self.vertices
        a, b, c = np.swapaxes(x[faces], 0, 1)
        inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
        faces[inward] = faces[inward][:, [0, 2, 1]]
        facets, corners = np.unique(hull.equations.round(12), axis=0), x[hull.vertices]
        # Rounding must leave no point of the surface outside.
        for some in np.array_split(facets, 1 + facets.size * len(corners) // _AT_ONCE**2):
            some[:, 3] = -(corners @ some[:, :3].T).max(axis=0) - _ROUNDING
        return corners, number[faces], facets

    @property
    def _box(self) -> tuple[Array, Indices, Array]:
        low, high = self.extent
        ends = np.column_stack([low - _ROUNDING, high + _ROUNDING])
        corners = np.stack(np.meshgrid(*ends, indexing="ij"), axis=-1).reshape(-1, 3)
        sides = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4],
                          [1, 5, 7, 3]])  # fmt: skip
        faces = np.vstack([sides[:, [0, 1, 2]], sides[:, [0, 2, 3]]])
        return corners, faces, np.zeros((0, 4))

    @property
    def hull(self) -> tuple[Array, float]:
        """Points (n, 3) and a distance: all within it of their convex hull holds the surface."""
        return self._hull[0], 0.0

    def support(self, directions: Array) -> Array:
        """How far the surface reaches in unit directions, (m, 3); (m,)."""
        return np.asarray((self._hull[0] @ directions.T).max(axis=0))

    @property
    def witness(self) -> Array:
        """A point of the surface."""
        point: Array = self.vertices[0]
        return point

    @cached_property
    def extent(self) -> tuple[Array, Array]:
        """Lowest and highest coordinates, (3,) each."""
        return self.vertices.min(axis=0), self.vertices.max(axis=0)

    def encloses(self, point: Array) -> bool:
        """Whether the surface winds round a point; for coal a mesh is but its surface.

        Solid angles are summed, so that a gap in the surface does little harm.
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


Shape: TypeAlias = Primitive | Mesh


@dataclass(frozen=True, eq=False)
class Part:
    """A shape and its placement in the frame of the solid that it is part of."""

    shape: Shape
    placement: Pose


@dataclass(frozen=True, eq=False)
class Solid:
    """A rigid body that may touch others: a robot's link, the object, an obstacle.

    Attributes:
        name: ``arm/link``, ``object``, an obstacle's name.
        carrier: what moves it.
        placement: its frame in the carrier's.
        parts: the shapes that it consists of.
    """

    name: str
    carrier: Carrier
    placement: Pose
    parts: tuple[Part, ...]


@dataclass(frozen=True, eq=False)
class LinkSolids:
    """The links of all arms as solids.

    Attributes:
        solids: links that have a shape; robot by robot the static ones, then those of its arms.
        mounts: (arm, name) of the static solids that an arm's first joint hangs on.
        ignored: names of two solids that nothing tests.
        notes: which shapes could not be read, and what else is doubtful.
    """

    solids: tuple[Solid, ...]
    mounts: frozenset[tuple[int, str]] = frozenset()
    ignored: frozenset[frozenset[str]] = frozenset()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class LinkLook:
    """Shapes by which a link may be shown.

    Attributes:
        name: the link's.
        carrier: what moves it.
        placement: the link's frame in the carrier's.
        choices: shapes in the link's frame, the best first; a mesh file need not be readable.
        shared: whether several arms stand on it.
    """

    name: str
    carrier: Carrier
    placement: Pose
    choices: tuple[tuple[Part, ...], ...]
    shared: bool = False
