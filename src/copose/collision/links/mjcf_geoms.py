"""The geoms of a MuJoCo model as shapes of its bodies, and the pairs that it excludes."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from copose.collision.links.link_geometry import Geometry, LinkPair, Looks, only_visual
from copose.collision.shapes.meshes import Mesh, ellipsoid_mesh, mesh_of
from copose.collision.shapes.primitives import Primitive
from copose.collision.shapes.solids import Part, Shape
from copose.poses import Pose
from copose.robots.files.mjcf_model import named
from copose.robots.files.tree import Tree
from copose.robots.robot import Robot


def mjcf_geometry(robot: Robot, measured: bool = False) -> Geometry:
    """The geoms of a model's bodies that may touch, or all where none may."""
    tree = robot.tree
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


def mjcf_looks(robot: Robot) -> Looks:
    """Shapes by which a model's bodies are shown, by name: geoms that nothing touches and that
    MuJoCo's own viewer shows, else all that it shows, else all.
    """
    tree, m = robot.tree, robot.tree.model
    reader = _Reader(m)
    geoms = [g for g in range(m.ngeom) if not reader.is_ground(g)]
    # MuJoCo's viewer hides the groups from 3 on.
    shown = [g for g in geoms if m.geom_group[g] < 3 and m.geom_rgba[g][3] > 0]
    pure = set(shown) - set(reader.touching)
    looks = {}
    for link, body in tree.bodies.items():
        choices = []
        for choice in ([g for g in shown if g in pure], shown, geoms):
            own = [(reader.shape(g), reader.place(g)) for g in choice if m.geom_bodyid[g] == body]
            choices.append(tuple(Part(shape, pose) for shape, pose in own if shape is not None))
        looks[link] = tuple(choices)
    return looks


def kept_apart(tree: Tree) -> dict[str, set[LinkPair]]:
    """Pairs of links that a model excludes by name, and those of which no two geoms may touch, by
    what in the model does so.
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
    return {"<exclude>": excluded, "contype and conaffinity": apart}


@dataclass(frozen=True, eq=False)
class _Reader:
    """A reader of the geoms of a compiled model, which reads every mesh once."""

    model: Any
    meshes: dict[int, Mesh | None] = field(default_factory=dict)

    @cached_property
    def touching(self) -> list[int]:
        """Geoms that may touch something."""
        m = self.model
        may = np.asarray(m.geom_contype) | np.asarray(m.geom_conaffinity)
        return [int(g) for g in np.flatnonzero(may)]

    def is_ground(self, g: int) -> bool:
        """True for a plane or a height field, which end only downwards, if at all."""
        return self._kind(g) in ("PLANE", "HFIELD")

    def place(self, g: int) -> Pose:
        """The pose of a geom in its body."""
        return Pose.from_quaternion(self.model.geom_pos[g], self.model.geom_quat[g])

    def shape(self, g: int) -> Shape | None:
        """The shape of a geom; None for a mesh that is none."""
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
                return ellipsoid_mesh(np.array(size))
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
            self.meshes[number] = mesh_of(corners, triangles) if sound else None
        return self.meshes[number]
