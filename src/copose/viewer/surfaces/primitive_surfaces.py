"""Primitives as triangles and edges, by the kind of primitive: one line each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from copose.collision import Primitive
from copose.poses import Array
from copose.viewer.surfaces.triangles import Triangles, box, capsule, circle, cylinder


@dataclass(frozen=True)
class SlabOptions:
    """Bodies of planar shapes, which lie about the plane."""

    thickness: float = 0.02  # m
    around: int = 72  # corners of a disk


def _box(primitive: Primitive, slab: SlabOptions) -> Triangles:
    return box(np.array([*primitive.size, slab.thickness][:3]))


def _sphere(primitive: Primitive, slab: SlabOptions) -> Triangles:
    (radius,) = primitive.size
    if primitive.flat:
        return cylinder(radius, slab.thickness, slab.around)
    return capsule(radius, 0.0)


def _box_edges(primitive: Primitive, slab: SlabOptions) -> Array:
    half = np.array([*primitive.size, slab.thickness][:3]) / 2
    ends = [
        [np.insert([a, b], axis, end) for end in (-1, 1)]
        for axis in range(3) for a in (-1, 1) for b in (-1, 1)
    ]  # fmt: skip
    return np.array(ends) * half


def _sphere_edges(primitive: Primitive, slab: SlabOptions) -> Array:
    """The rim of a disk's upper side; none of a sphere."""
    if not primitive.flat:
        return np.zeros((0, 2, 3))
    (radius,) = primitive.size
    return circle() * [radius, radius, 0.0] + [0, 0, slab.thickness / 2]


TRIANGLES: dict[str, Callable[[Primitive, SlabOptions], Triangles]] = {
    "box": _box,
    "sphere": _sphere,
    "cylinder": lambda primitive, _slab: cylinder(primitive.size[0], primitive.size[1]),
    "capsule": lambda primitive, _slab: capsule(primitive.size[0], primitive.size[1]),
}
# Of the kinds that have edges.
EDGES: dict[str, Callable[[Primitive, SlabOptions], Array]] = {
    "box": _box_edges,
    "sphere": _sphere_edges,
}


def primitive_triangles(primitive: Primitive, slab: SlabOptions = SlabOptions()) -> Triangles:
    """The surface of a primitive in its own frame; of a planar one that of a slab."""
    return TRIANGLES[primitive.kind](primitive, slab)


def primitive_edges(primitive: Primitive, slab: SlabOptions = SlabOptions()) -> Array:
    """Edges of a box or a slab, m, (e, 2, 3); none of other primitives."""
    edges = EDGES.get(primitive.kind)
    return np.zeros((0, 2, 3)) if edges is None else edges(primitive, slab)
