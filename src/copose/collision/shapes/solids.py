"""Rigid bodies that may touch, and the shapes that they consist of."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from copose.collision.carriers import Carrier
from copose.collision.shapes.meshes import Mesh
from copose.collision.shapes.primitives import Primitive
from copose.poses import Array, Pose

Shape: TypeAlias = Primitive | Mesh


@dataclass(frozen=True, eq=False)
class Part:
    """A shape and its placement in the frame of the solid that it is part of."""

    shape: Shape
    placement: Pose


@dataclass(frozen=True, eq=False)
class Solid:
    """A rigid body that may touch others: a robot's link, the object, an obstacle."""

    name: str  # ``arm/link``, ``object``, an obstacle's name
    carrier: Carrier  # what moves it
    placement: Pose  # its frame in the carrier's
    parts: tuple[Part, ...]  # the shapes that it consists of


@dataclass(frozen=True, eq=False)
class LinkSolids:
    """The links of all arms as solids."""

    # Links that have a shape; robot by robot the static ones, then those of its arms.
    solids: tuple[Solid, ...]
    # (arm, name) of the static solids that an arm's first joint hangs on.
    mounts: frozenset[tuple[int, str]] = frozenset()
    ignored: frozenset[frozenset[str]] = frozenset()  # names of two solids that nothing tests
    notes: tuple[str, ...] = ()  # which shapes could not be read, and what else is doubtful


@dataclass(frozen=True, eq=False)
class LinkLook:
    """Shapes by which a link may be shown."""

    name: str
    carrier: Carrier  # what moves it
    placement: Pose  # the link's frame in the carrier's
    # Shapes in the link's frame, the best first; a mesh file need not be readable.
    choices: tuple[tuple[Part, ...], ...]
    shared: bool = False  # whether several arms stand on it


@dataclass(frozen=True, eq=False)
class Outline:
    """The outline of one convex part of a link."""

    carrier: Carrier  # what moves the link
    points: Array  # in the carrier's frame, (k, 3)


@dataclass(frozen=True)
class OutlineOptions:
    """Fineness of outlines."""

    turns: int = 24  # directions of the plane in which an outline reaches as far as its shape
    grid: int = 5  # directions of space to an edge of a cube, in which it does
    digits: int = 5  # of a metre that a picture shows

    def directions(self, *, planar: bool) -> Array:
        """Unit directions in which outlines reach as far as their shapes, (m, 3)."""
        if planar:
            angles = np.linspace(0.0, 2 * np.pi, self.turns, endpoint=False)
            return np.column_stack([np.cos(angles), np.sin(angles), np.zeros(self.turns)])
        ends, grid = {0, self.grid - 1}, np.ndindex(self.grid, self.grid, self.grid)
        cube = np.array([place for place in grid if ends & set(place)]) - (self.grid - 1) / 2
        return np.asarray(cube / np.linalg.norm(cube, axis=1, keepdims=True))


def link_outlines(
    solids: Sequence[Solid], *, planar: bool, options: OutlineOptions = OutlineOptions()
) -> list[Outline]:
    """The outlines of those solids that are links of arms."""
    links = [solid for solid in solids if solid.carrier.kind in ("root", "joint")]
    directions = options.directions(planar=planar)
    return [outline for link in links for outline in _outlines(link, directions, options.digits)]


def _outlines(solid: Solid, directions: Array, digits: int) -> Iterator[Outline]:
    for part in solid.parts:
        pose = solid.placement @ part.placement
        corners, beyond = part.shape.hull
        corners = corners @ pose.rotation.T + pose.position
        outermost = (corners @ directions.T).argmax(axis=0)
        points = np.round(corners[outermost] + beyond * directions, digits) + 0.0
        # NumPy's own unique loads masked arrays.
        yield Outline(solid.carrier, np.array(sorted(set(map(tuple, points.tolist())))))
