"""The shapes that a URDF gives its links: boxes, spheres, cylinders, capsules and mesh files."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from copose.collision.geometry import Geometry, listed, only_visual
from copose.collision.mesh_files import MeshFile, UnreadableError, loaded_mesh
from copose.collision.solids import Mesh, Part, Primitive, Shape
from copose.errors import InputError, shown
from copose.robots.paths import PACKAGE, MissingPackageError, resolve
from copose.robots.robot import Robot
from copose.robots.urdf_tree import numbers, placement

_FILE = "file://"
_VISUAL = "tested by visual geometry, for no collision geometry can be read"


def urdf_geometry(robot: Robot, *, measured: bool) -> Geometry:
    """The collision elements of a URDF's links, or what can stand in for them.

    Visual elements stand in where a link's collision elements cannot be read, and where the
    URDF has no collision elements at all.

    Args:
        robot: the URDF, read.
        measured: whether they are but measured, for which meshes are read in a third of the time.
    """
    tree = robot.tree
    links = {name: link.element for name, link in tree.links.items() if link.element is not None}
    notes = []
    tag: Literal["collision", "visual"] = "collision"
    if all(link.find("collision") is None for link in links.values()):
        tag = "visual"
        if any(link.find("visual") is not None for link in links.values()):
            notes.append(only_visual(tree.file))
    reader = _Reader(
        tree.file, robot.packages, lambda file, scale: Mesh(loaded_mesh(file, scale, measured))
    )
    parts: dict[str, tuple[Part, ...]] = {}
    faults: dict[str, str] = {}
    instead: dict[str, str] = {}
    for name, link in links.items():
        parts[name], why = reader.read(link, tag)
        if why and tag == "collision":
            visual, unreadable = reader.read(link, "visual")
            if visual and not unreadable:
                parts[name], instead[name], why = visual, why, ""
        if why:
            faults[name] = why
    missing = tuple(sorted(reader.missing))
    notes += missing
    if instead:
        notes.append(f"{tree.file.name}: links {_VISUAL}: {listed(instead)}")
    return Geometry(parts, faults, notes, missing)


def urdf_looks(robot: Robot) -> dict[str, tuple[tuple[Part, ...], ...]]:
    """Shapes by which a URDF's links are shown, by name: visual elements, else collision elements.

    No mesh file is read yet; elements that name none are left out.
    """
    reader = _Reader(robot.tree.file, robot.packages, MeshFile)
    return {
        name: tuple(reader.read(link.element, tag)[0] for tag in ("visual", "collision"))
        for name, link in robot.tree.links.items()
        if link.element is not None
    }


@dataclass(frozen=True, eq=False)
class _Reader:
    """Reads elements of one URDF, every mesh file once."""

    file: Path
    packages: Mapping[str, Path]
    mesh: Callable[[Path, tuple[float, ...]], Mesh]
    meshes: dict[tuple[Path, tuple[float, ...]], Mesh] = field(default_factory=dict)
    missing: set[str] = field(default_factory=set)

    def read(self, link: ET.Element, tag: str) -> tuple[tuple[Part, ...], str]:
        """The readable elements of a link, and why the first that is not cannot be read."""
        parts, why = [], ""
        for element in link.findall(tag):
            try:
                part = self._part(element)
            except UnreadableError as error:
                why = why or str(error)
            else:
                parts += [part] if part is not None else []
        return tuple(parts), why

    def _part(self, element: ET.Element) -> Part | None:
        """The shape of an element and where it is; None of one without any extent."""
        geometry = element.find("geometry")
        if geometry is None or not len(geometry):
            raise UnreadableError("no geometry")
        try:
            shape, pose = self._shape(geometry[0]), placement(element)
        except ValueError as error:
            raise UnreadableError(str(error)) from None
        if isinstance(shape, Primitive) and min(shape.size) == 0:
            if any(shape.size):
                raise UnreadableError(f"a {shape.kind} has no extent: {shown(shape.size)}")
            return None
        return Part(shape, pose)

    def _shape(self, element: ET.Element) -> Shape:
        if element.tag == "mesh":
            scale = numbers(element, "scale", 3, "1 1 1")
            return self._mesh(element.get("filename", ""), scale)
        if element.tag == "box":
            return Primitive("box", _lengths(element, "size", 3))
        if element.tag == "sphere":
            return Primitive("sphere", _lengths(element, "radius", 1))
        for kind in ("cylinder", "capsule"):
            if element.tag == kind:
                size = (*_lengths(element, "radius", 1), *_lengths(element, "length", 1))
                return Primitive("cylinder" if kind == "cylinder" else "capsule", size)
        raise UnreadableError(f"unknown geometry {shown(element.tag)}")

    def _mesh(self, name: str, scale: tuple[float, ...]) -> Mesh:
        file = None
        try:
            file = mesh_file(name, self.file, self.packages)
        except MissingPackageError as error:
            self.missing.add(error.message)
        if file is None:
            raise UnreadableError(f"mesh {shown(name)} was not found")
        if (file, scale) not in self.meshes:
            self.meshes[file, scale] = self.mesh(file, scale)
        return self.meshes[file, scale]


def mesh_file(name: str, urdf: Path, packages: Mapping[str, Path]) -> Path | None:
    """The mesh that a URDF names, or None where it is not there.

    Args:
        name: ``package://…``, ``model://…``, ``file://…``, or a path relative to the URDF.
        urdf: its file; a package that it lies in, or beside, is found without ROS.
        packages: folders of packages by name, looked into first.

    Raises:
        MissingPackageError: no folder was found for the package; the message says where was looked.
    """
    rest = name.removeprefix("model://")
    name = PACKAGE + rest if rest != name else name.removeprefix(_FILE)
    try:
        path = resolve(name, urdf.parent, packages, urdf.parents)
        return path if path.is_file() else None
    except MissingPackageError:
        raise
    except (InputError, OSError, ValueError, RuntimeError):
        # What pathlib makes of unknown users, zero bytes and endless names.
        return None


def _lengths(element: ET.Element, key: str, count: int) -> tuple[float, ...]:
    values = numbers(element, key, count)
    if min(values) < 0:
        raise UnreadableError(f"{key} is {shown(element.get(key))}")
    return values
