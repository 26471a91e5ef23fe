"""The shapes that a MuJoCo model gives its bodies, and which pairs of bodies it keeps apart."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from copose.collision.geometry import Geometry, only_visual
from copose.collision.solids import Mesh, Part, Primitive, Shape
from copose.poses import Array, Indices, Pose
from copose.robots.mjcf_tree import named
from copose.robots.tree import Tree

# How often the triangles of an octahedron are quartered for an ellipsoid: it then has 512.
_QUARTERED = 3
# Geoms from this group on MuJoCo's viewer hides.
_HIDDEN = 3


def mjcf_geometry(tree: Tree) -> Geometry:
    """The geoms of a model's bodies that may touch, or all where none may."""
    reader = _Reader(tree.model)
    notes = []
    geoms = reader.touching
    if not geoms and reader.model.ngeom:
        geoms = list(range(reader.model.ngeom))
        notes.append(only_visual(tree.file))
    parts: dict[str, tuple[Part, ...]] = {}
    faults: dict[str, str] = {}
    endless: list[str] = []
    for link, body in tree.bodies.items():
        placed: list[Part] = []
        for g in (g for g in geoms if reader.model.geom_bodyid[g] == body):
            if reader.is_ground(g):
                endless.append(link)
                continue
            shape = reader.shape(g)
            if shape is None:
                faults[link] = "a mesh without triangles, or with vertices that are not finite"
            else:
                placed.append(Part(shape, reader.place(g)))
        parts[link] = tuple(placed)
    if endless:
        links = ", ".join(dict.fromkeys(endless))
        notes.append(
            f"{tree.file.name}: planes and height fields are not tested (of {links}); give what "
            "matters of them as obstacles"
        )
    return Geometry(parts, faults, notes)


def mjcf_looks(tree: Tree) -> dict[str, tuple[tuple[Part, ...], ...]]:
    """Shapes by which a model's bodies are shown, by name: geoms that nothing touches and that
    MuJoCo's own viewer shows, else all that it shows, else all.
    """
    reader = _Reader(tree.model)
    m = tree.model
    geoms = [g for g in range(m.ngeom) if not reader.is_ground(g)]
    shown = [g for g in geoms if m.geom_group[g] < _HIDDEN and m.geom_rgba[g][3] > 0]
    pure = set(shown) - set(reader.touching)
    found = {}
    for link, body in tree.bodies.items():
        choices = []
        for some in ([g for g in shown if g in pure], shown, geoms):
            own = [(reader.shape(g), reader.place(g)) for g in some if m.geom_bodyid[g] == body]
            choices.append(tuple(Part(shape, pose) for shape, pose in own if shape is not None))
        found[link] = tuple(choices)
    return found


def kept_apart(tree: Tree) -> tuple[set[tuple[str, str]], set[tuple[str, str]]]:
    """Pairs of links that a model excludes by name, and those of which no two geoms may touch, by
    contype and conaffinity.
    """
    m = tree.model
    link = {body: name for name, body in tree.bodies.items()}
    signs = (int(sign) for sign in m.exclude_signature)
    excluded = {(link[sign >> 16], link[sign & 0xFFFF]) for sign in signs}
    bits: dict[str, set[tuple[int, int]]] = {}
    reader = _Reader(m)
    for g in (g for g in reader.touching if not reader.is_ground(g)):
        pair = int(m.geom_contype[g]), int(m.geom_conaffinity[g])
        bits.setdefault(link[int(m.geom_bodyid[g])], set()).add(pair)
    apart = {
        (a, b)
        for a, b in itertools.combinations(bits, 2)
        if not any(c & f or d & e for c, d in bits[a] for e, f in bits[b])
    }
    return excluded, apart


@dataclass(frozen=True, eq=False)
class _Reader:
    """Reads geoms of a compiled model, every mesh once."""

    model: Any
    meshes: dict[int, Mesh | None] = field(default_factory=dict)

    @cached_property
    def touching(self) -> list[int]:
        """Geoms that may touch something."""
        m = self.model
        may = np.asarray(m.geom_contype) | np.asarray(m.geom_conaffinity)
        return [int(g) for g in np.flatnonzero(may)]

    def is_ground(self, g: int) -> bool:
        """Whether a geom is a plane or a height field, which have an end only downwards, if any."""
        return self._kind(g) in ("PLANE", "HFIELD")

    def place(self, g: int) -> Pose:
        """Where a geom is in its body."""
        return Pose.from_quaternion(self.model.geom_pos[g], self.model.geom_quat[g])

    def shape(self, g: int) -> Shape | None:
        """The shape of a geom; None of a mesh that is none."""
        size = self.model.geom_size[g].tolist()
        match self._kind(g):
            case "SPHERE":
                return Primitive("sphere", (size[0],))
            case "CAPSULE":
                return Primitive("capsule", (size[0], 2 * size[1]))
            case "CYLINDER":
                return Primitive("cylinder", (size[0], 2 * size[1]))
            case "BOX":
                return Primitive("box", tuple(2 * half for half in size))
            case "ELLIPSOID":
                return _ellipsoid(np.array(size))
            case _:
                return self._mesh(int(self.model.geom_dataid[g]))

    def _kind(self, g: int) -> str:
        import mujoco

        return named(mujoco.mjtGeom, self.model.geom_type[g])

    def _mesh(self, number: int) -> Mesh | None:
        if number not in self.meshes:
            m = self.model
            first, count = m.mesh_vertadr[number], m.mesh_vertnum[number]
            corners = np.array(m.mesh_vert[first : first + count], dtype=np.float64)
            first, count = m.mesh_faceadr[number], m.mesh_facenum[number]
            triangles = np.array(m.mesh_face[first : first + count], dtype=np.intp)
            sound = len(triangles) and np.isfinite(corners).all()
            self.meshes[number] = _surface(corners, triangles) if sound else None
        return self.meshes[number]


def _surface(corners: Array, triangles: Indices) -> Mesh:
    import coal

    surface = coal.BVHModelOBBRSS()
    surface.beginModel(len(triangles), len(corners))
    surface.addVertices(corners)
    surface.addTriangles(triangles)
    surface.endModel()
    return Mesh(surface)


def _ellipsoid(axes: Array) -> Mesh:
    """A polyhedron that holds an ellipsoid, by its semi-axes, m, (3,)."""
    corners, triangles = _ball()
    return _surface(corners * axes, triangles)


def _ball() -> tuple[Array, Indices]:
    """Corners and triangles of a polyhedron that holds the unit ball, wound outwards."""
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

    for _ in range(_QUARTERED):
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
