"""Triangles of primitives, arrows and surfaces of revolution; circles and edges as segments."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from copose.collision import Primitive
from copose.poses import Array, Indices, Pose


@dataclass(frozen=True, eq=False)
class Triangles:
    """A surface of triangles."""

    vertices: Array  # its corners, m, (v, 3)
    faces: Indices  # corners of each triangle by number, (f, 3)

    def placed(self, pose: Pose) -> Triangles:
        """The same surface seen from the frame in which a pose places its own."""
        return Triangles(self.vertices @ pose.rotation.T + pose.position, self.faces)

    @property
    def areas(self) -> Array:
        """Areas of its triangles, m², (f,)."""
        a, b, c = np.swapaxes(self.vertices[self.faces], 0, 1)
        return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)

    def scattered(self, count: int, rng: np.random.Generator) -> Array:
        """Points drawn evenly from the surface, m, (count, 3)."""
        areas = self.areas
        share = areas / areas.sum() if areas.any() else np.full(len(areas), 1 / len(areas))
        a, b, c = np.swapaxes(
            self.vertices[self.faces[rng.choice(len(share), count, p=share)]], 0, 1
        )
        u, v = rng.random((2, count, 1))
        beyond = u + v > 1
        u, v = np.where(beyond, 1 - u, u), np.where(beyond, 1 - v, v)
        return np.asarray(a + u * (b - a) + v * (c - a))


def joined(parts: list[Triangles]) -> Triangles:
    """Several surfaces as one."""
    first = np.cumsum([0, *(len(part.vertices) for part in parts)])
    return Triangles(
        np.vstack([part.vertices for part in parts]),
        np.vstack([part.faces + k for part, k in zip(parts, first[:-1], strict=True)]),
    )


def box(size: Array) -> Triangles:
    """A box by its edge lengths, (3,), centred."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * size / 2
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [[a, b, c] for a, b, c, _ in sides] + [[a, c, d] for a, _, c, d in sides]
    return Triangles(corners, np.array(faces))


def revolved(radii: Array, heights: Array, around: int = 24) -> Triangles:
    """The surface that a curve of radii, 0 at both ends, and heights, (k,) each, sweeps about z,
    from the lowest point up.
    """
    angles = np.arange(around) * 2 * np.pi / around
    ring = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(around)])
    inner = [r * ring + [0, 0, z] for r, z in zip(radii[1:-1], heights[1:-1], strict=True)]
    ends = [[0, 0, heights[0]], [0, 0, heights[-1]]]
    vertices = np.vstack([ends, *inner])
    k = np.arange(around)
    after = (k + 1) % around
    faces = [np.column_stack([np.zeros_like(k), 2 + after, 2 + k])]
    for row in range(len(inner) - 1):
        low, high = 2 + row * around, 2 + (row + 1) * around
        faces.append(np.column_stack([low + k, low + after, high + after]))
        faces.append(np.column_stack([low + k, high + after, high + k]))
    top = 2 + (len(inner) - 1) * around
    faces.append(np.column_stack([np.ones_like(k), top + k, top + after]))
    return Triangles(vertices, np.vstack(faces))


def cylinder(radius: float, length: float, around: int = 24) -> Triangles:
    """A cylinder along z, centred, with a number of corners around."""
    half = length / 2
    return revolved(np.array([0, radius, radius, 0]), np.array([-half, -half, half, half]), around)


def capsule(radius: float, length: float, down: int = 12) -> Triangles:
    """The solid within a radius, m, of a segment of a length along z, centred; without a length a
    sphere, of an even number of steps from pole to pole.
    """
    angles = np.linspace(-np.pi / 2, np.pi / 2, down + 1)
    heights, radii = radius * np.sin(angles), radius * np.cos(angles)
    radii[[0, -1]] = 0.0
    if not length:
        return revolved(radii, heights)
    half, middle = length / 2, down // 2 + 1
    heights = np.concatenate([heights[:middle] - half, heights[middle - 1 :] + half])
    return revolved(np.concatenate([radii[:middle], radii[middle - 1 :]]), heights)


def between(start: Array, end: Array, radius: float) -> Triangles:
    """A capsule from a point, (3,), to another."""
    along = end - start
    length = float(np.linalg.norm(along))
    middle = (start + end) / 2
    upright = capsule(radius, length)
    if not length:
        return Triangles(upright.vertices + middle, upright.faces)
    return upright.placed(Pose.make(middle, turned_to(along), np.zeros(4)))


def turned_to(direction: Array) -> Array:
    """A rotation that turns z to a direction, (3,), not zero; (3, 3)."""
    z = direction / np.linalg.norm(direction)
    x = np.cross(np.eye(3)[int(np.abs(z).argmin())], z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def ball() -> Triangles:
    """A sphere of radius 1."""
    return capsule(1.0, 0.0)


def circle(count: int = 72) -> Array:
    """A circle of radius 1 about z as segments, (count, 2, 3)."""
    angles = np.linspace(0, 2 * np.pi, count + 1)
    points = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(count + 1)])
    return np.stack([points[:-1], points[1:]], axis=1)


@dataclass(frozen=True)
class ArrowShape:
    """Proportions of an arrow of length 1, and of one that goes round at radius 1."""

    shaft: float = 0.025  # radius
    head: float = 0.07  # radius of the head
    point: float = 0.22  # length of the head
    turn: float = 1.5 * np.pi  # rad, that a round arrow goes
    steps: int = 36  # along a round arrow
    sides: int = 10  # corners of a cross-section of it


def arrow() -> Triangles:
    """An arrow of length 1 along z, from the origin."""
    shaft, head, neck = ArrowShape.shaft, ArrowShape.head, 1 - ArrowShape.point
    return revolved(np.array([0, shaft, shaft, head, 0]), np.array([0, 0, neck, neck, 1.0]))


def round_arrow() -> Triangles:
    """An arrow that goes round z at radius 1, counter-clockwise, and not all the way."""
    shaft, point, sides = ArrowShape.shaft, ArrowShape.point, ArrowShape.sides
    angles = np.linspace(0, ArrowShape.turn - 2 * point, ArrowShape.steps)
    about = np.arange(sides) * 2 * np.pi / sides
    a, b = np.meshgrid(angles, about, indexing="ij")
    out = 1 + 2 * shaft * np.cos(b)
    vertices = np.stack([out * np.cos(a), out * np.sin(a), 2 * shaft * np.sin(b)], axis=-1)
    k = np.arange(sides)
    after = (k + 1) % sides
    faces = []
    for step in range(ArrowShape.steps - 1):
        low, high = step * sides, (step + 1) * sides
        faces.append(np.column_stack([low + k, high + k, high + after]))
        faces.append(np.column_stack([low + k, high + after, low + after]))
    end = angles[-1]
    ahead = np.array([-np.sin(end), np.cos(end), 0.0])
    place = np.array([np.cos(end), np.sin(end), 0.0])
    head = revolved(np.array([0, 2 * ArrowShape.head, 0]), np.array([0, 0, 2 * point]))
    head = head.placed(Pose.make(place, turned_to(ahead), np.zeros(4)))
    return joined([Triangles(vertices.reshape(-1, 3), np.vstack(faces)), head])


@dataclass(frozen=True)
class SlabOptions:
    """Bodies of planar shapes, which lie about the plane."""

    thickness: float = 0.02  # m
    around: int = 72  # corners of a disk


def _box(primitive: Primitive) -> Triangles:
    return box(np.array([*primitive.size, SlabOptions.thickness][:3]))


def _sphere(primitive: Primitive) -> Triangles:
    (radius,) = primitive.size
    if primitive.flat:
        return cylinder(radius, SlabOptions.thickness, SlabOptions.around)
    return capsule(radius, 0.0)


def _box_edges(primitive: Primitive) -> Array:
    half = np.array([*primitive.size, SlabOptions.thickness][:3]) / 2
    ends = [
        [np.insert([a, b], axis, end) for end in (-1, 1)]
        for axis in range(3) for a in (-1, 1) for b in (-1, 1)
    ]  # fmt: skip
    return np.array(ends) * half


def _sphere_edges(primitive: Primitive) -> Array:
    """The rim of a disk's upper side; none of a sphere."""
    if not primitive.flat:
        return np.zeros((0, 2, 3))
    (radius,) = primitive.size
    return circle() * [radius, radius, 0.0] + [0, 0, SlabOptions.thickness / 2]


TRIANGLES: dict[str, Callable[[Primitive], Triangles]] = {
    "box": _box,
    "sphere": _sphere,
    "cylinder": lambda primitive: cylinder(primitive.size[0], primitive.size[1]),
    "capsule": lambda primitive: capsule(primitive.size[0], primitive.size[1]),
}
# Of the kinds that have edges.
EDGES: dict[str, Callable[[Primitive], Array]] = {
    "box": _box_edges,
    "sphere": _sphere_edges,
}


def primitive_triangles(primitive: Primitive) -> Triangles:
    """The surface of a primitive in its own frame; of a planar one that of a SlabOptions."""
    return TRIANGLES[primitive.kind](primitive)


def primitive_edges(primitive: Primitive) -> Array:
    """Edges of a box or a slab, m, (e, 2, 3); none of other primitives."""
    edges = EDGES.get(primitive.kind)
    return np.zeros((0, 2, 3)) if edges is None else edges(primitive)
