"""Primitives: boxes, spheres, cylinders and capsules by their measures."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, TypeAlias

import numpy as np

from copose.poses import Array

Size: TypeAlias = tuple[float, ...]


class _Geometry(ABC):
    """Geometry of one kind of primitive as functions of its measures, m, and of its being flat."""

    round = False

    @abstractmethod
    def coal(self, size: Size, flat: bool) -> Any:
        """The shape for coal; of a planar shape a slab, whose nearest points lie in the plane."""

    @abstractmethod
    def hull(self, size: Size, flat: bool) -> tuple[Array, float]:
        """Points, (n, 3), and a distance: all within it of their convex hull holds the shape."""

    @abstractmethod
    def support(self, size: Size, directions: Array) -> Array:
        """The shape's reach in unit directions, (m, 3); m, (m,)."""


@dataclass(frozen=True)
class _Box(_Geometry):
    slab: float = 1.0  # m, thickness of a rectangle

    def coal(self, size: Size, flat: bool) -> Any:
        import coal

        return coal.Box(*size, self.slab) if flat else coal.Box(*size)

    def hull(self, size: Size, flat: bool) -> tuple[Array, float]:
        x, y, z = (*size, 0.0)[:3]
        ends = [(-x, x), (-y, y), (-z, z) if not flat else (0.0,)]
        return np.stack(np.meshgrid(*ends), axis=-1).reshape(-1, 3) / 2, 0.0

    def support(self, size: Size, directions: Array) -> Array:
        x, y, z = np.abs(directions.T)
        return np.asarray((np.column_stack([x, y, z][: len(size)]) @ size) / 2)


class _Round(_Geometry):
    """All points within a radius of a segment along z, or of the origin."""

    round = True

    def hull(self, size: Size, flat: bool) -> tuple[Array, float]:
        radius, *length = size
        end = np.array([0.0, 0.0, sum(length) / 2])
        return np.array([-end, end]), radius

    def support(self, size: Size, directions: Array) -> Array:
        radius, *length = size
        return np.asarray(np.abs(directions[:, 2]) * sum(length) / 2 + radius)


@dataclass(frozen=True)
class _Sphere(_Round):
    slab: float = 1.0  # m, thickness of a disk

    def coal(self, size: Size, flat: bool) -> Any:
        import coal

        return coal.Cylinder(*size, self.slab) if flat else coal.Sphere(*size)


class _Capsule(_Round):
    def coal(self, size: Size, flat: bool) -> Any:
        import coal

        return coal.Capsule(*size)


@dataclass(frozen=True)
class _Cylinder(_Geometry):
    sides: int = 24  # of the prism that holds it

    def coal(self, size: Size, flat: bool) -> Any:
        import coal

        return coal.Cylinder(*size)

    def hull(self, size: Size, flat: bool) -> tuple[Array, float]:
        radius, length = size
        angles = np.arange(self.sides) * 2 * np.pi / self.sides
        outer = radius / np.cos(np.pi / self.sides)
        rim = outer * np.column_stack([np.cos(angles), np.sin(angles)])
        ends = [np.column_stack([rim, np.full(self.sides, z)]) for z in (-length / 2, length / 2)]
        return np.vstack(ends), 0.0

    def support(self, size: Size, directions: Array) -> Array:
        radius, length = size
        x, y, z = np.abs(directions.T)
        return np.asarray(z * length / 2 + np.hypot(x, y) * radius)


Kind: TypeAlias = Literal["box", "sphere", "cylinder", "capsule"]
GEOMETRIES: dict[Kind, _Geometry] = {
    "box": _Box(),
    "sphere": _Sphere(),
    "cylinder": _Cylinder(),
    "capsule": _Capsule(),
}


@dataclass(frozen=True)
class Primitive:
    """A shape by its measures, m, centred in its frame."""

    # A box, a sphere, a cylinder along z, or all points within a radius of a segment along z, a
    # capsule.
    kind: Kind
    size: Size  # edge lengths; radius; radius and length; radius and length of the segment
    flat: bool = False  # whether it is planar: a rectangle is a box of two edges, a disk a sphere

    @property
    def _geometry(self) -> _Geometry:
        return GEOMETRIES[self.kind]

    @cached_property
    def coal(self) -> Any:
        """The same shape for coal."""
        return self._geometry.coal(self.size, self.flat)

    @property
    def bound(self) -> Any:
        """A convex shape for coal that contains it: itself."""
        return self.coal

    @property
    def below(self) -> float:
        """Largest distance of a point of the bound from the shape, m."""
        return 0.0

    @property
    def hollow(self) -> bool:
        """False: to coal a primitive has an inside."""
        return False

    @property
    def round(self) -> bool:
        """True for a sphere and a capsule: all within a distance of a segment, see `hull`."""
        return self._geometry.round

    @cached_property
    def hull(self) -> tuple[Array, float]:
        """Points, (n, 3), and a distance: all within it of their convex hull holds the shape."""
        return self._geometry.hull(self.size, self.flat)

    def support(self, directions: Array) -> Array:
        """The shape's reach in unit directions, (m, 3); m, (m,)."""
        return self._geometry.support(self.size, directions)

    @property
    def witness(self) -> Array:
        """A point of the shape."""
        return np.zeros(3)

    def encloses(self, point: Array) -> bool:
        """False: what is within a primitive overlaps it to coal."""
        return False

    @property
    def fingerprint(self) -> bytes:
        """Equal for shapes that look alike."""
        return repr((self.kind, self.size)).encode()
