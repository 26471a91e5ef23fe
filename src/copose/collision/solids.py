"""Bodies that may touch: the shapes that problem files and URDFs name, and meshes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, Literal, TypeAlias

import numpy as np

from copose.collision.boxes import around_box
from copose.collision.capsules import Capsule, around_hull, around_surface
from copose.collision.carriers import Carrier
from copose.collision.remembered import remembered
from copose.poses import Array, Indices, Pose, frozen_array

# A planar shape is a slab this thick to the exact distances: what is nearest lies in the plane.
_THICKNESS = 1.0
# Sides of the prism round a cylinder that is covered in its place.
_SIDES = 24


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
    def capsules(self) -> tuple[Capsule, ...]:
        """Capsules that together contain the shape, in its frame."""
        return _capsules(self)

    @cached_property
    def hull(self) -> tuple[Array, float]:
        """Points (n, 3) and a distance: all within it of their convex hull holds the shape."""
        if self.kind in ("box", "cylinder"):
            return self.corners, 0.0
        (capsule,) = self.capsules
        return np.array([capsule.a, capsule.b]), capsule.radius

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


@lru_cache(maxsize=1000)
def _capsules(shape: Primitive) -> tuple[Capsule, ...]:
    """Fitted once for all shapes of the same measures: the two sides of a robot have them alike."""
    if shape.kind == "sphere":
        return (Capsule(frozen_array(np.zeros(3)), frozen_array(np.zeros(3)), shape.size[0]),)
    if shape.kind == "capsule":
        radius, length = shape.size
        end = np.array([0.0, 0.0, length / 2])
        return (Capsule(frozen_array(-end), frozen_array(end), radius),)
    if shape.kind == "box":
        return around_box(shape.size)
    return remembered(around_hull, shape.corners)


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
    def capsules(self) -> tuple[Capsule, ...]:
        """Capsules that together contain the surface."""
        return remembered(around_surface, self.vertices, self.triangles)

    @property
    def hull(self) -> tuple[Array, float]:
        """Points (n, 3) and a distance: all within it of their convex hull holds the surface."""
        return self.vertices, 0.0

    @property
    def witness(self) -> Array:
        """A point of the surface."""
        point: Array = self.vertices[0]
        return point

    @cached_property
    def extent(self) -> tuple[Array, Array]:
        """Lowest and highest coordinates, (3,) each."""
        return self.vertices.min(axis=0), self.vertices.max(axis=0)

    @cached_property
    def _faces(self) -> tuple[Array, Array]:
        """N and d of {x : N x ≤ d}: the vertices' convex hull, or all of space if that is flat."""
        from scipy.spatial import ConvexHull, QhullError

        try:
            equations = ConvexHull(self.vertices).equations
        except (QhullError, ValueError):
            return np.zeros((0, 3)), np.zeros(0)
        normals = equations[:, :3]
        return normals, (self.vertices @ normals.T).max(axis=0)

    def encloses(self, point: Array) -> bool:
        """Whether the surface winds round a point; for coal a mesh is but its surface.

        Solid angles are summed, so that a gap in the surface does little harm.
        """
        normals, offsets = self._faces
        if np.any(normals @ point > offsets):
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

    @cached_property
    def capsules(self) -> tuple[Capsule, ...]:
        """Capsules that together contain it, in the carrier's frame."""
        found = []
        for part in self.parts:
            pose = self.placement @ part.placement
            for capsule in part.shape.capsules:
                a, b = (pose.rotation @ end + pose.position for end in (capsule.a, capsule.b))
                found.append(Capsule(frozen_array(a), frozen_array(b), capsule.radius))
        return tuple(found)
