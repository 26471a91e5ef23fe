"""The shapes that a URDF gives its links: boxes, spheres, cylinders, capsules and mesh files."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from copose.collision.solids import Mesh, Part, Primitive, Shape
from copose.errors import InputError, shown
from copose.robots.paths import PACKAGE, MissingPackageError, resolve
from copose.robots.urdf import Robot
from copose.robots.urdf_tree import numbers, placement

_FILE = "file://"
# Links that a note names one by one.
_NAMED = 5

_LEFT_OUT = "left out of collision tests, for no shape can be read"
_VISUAL = "tested by visual geometry, for no collision geometry can be read"
_REST = "tested without some of the collision geometry"


class _UnreadableError(Exception):
    """Why an element gives no shape."""


@dataclass(frozen=True, eq=False)
class LinkShapes:
    """The shapes of a URDF's links.

    Attributes:
        parts: of the links that have any, placed in the link's frame.
        notes: which could not be read, and what stands in for them.
        missing: on packages that were not found, where was looked; among the notes too.
    """

    parts: dict[str, tuple[Part, ...]]
    notes: tuple[str, ...]
    missing: tuple[str, ...]

    @classmethod
    def of(cls, robot: Robot) -> LinkShapes:
        """The collision elements of a URDF's links, or what can stand in for them.

        Visual elements stand in where a link's collision elements cannot be read, and where the
        URDF has no collision elements at all.
        """
        tree = robot.tree
        links = {name: link.element for name, link in tree.links.items()}
        notes = []
        tag: Literal["collision", "visual"] = "collision"
        if all(link.find("collision") is None for link in links.values()):
            tag = "visual"
            if any(link.find("visual") is not None for link in links.values()):
                notes.append(
                    f"{tree.file.name} has no collision geometry; its visual geometry is tested"
                )
        reader = _Reader(tree.file, robot.packages)
        parts: dict[str, tuple[Part, ...]] = {}
        faults: dict[str, list[str]] = {_VISUAL: [], _REST: [], _LEFT_OUT: []}
        for name, link in links.items():
            parts[name], why = reader.read(link, tag)
            outcome = _REST if parts[name] else _LEFT_OUT
            if why and tag == "collision":
                instead, unreadable = reader.read(link, "visual")
                if instead and not unreadable:
                    parts[name], outcome = instead, _VISUAL
            if why:
                faults[outcome].append(f"{name} ({why})")
        missing = tuple(sorted(reader.missing))
        notes += missing
        for outcome, found in faults.items():
            if found:
                more = f" and {len(found) - _NAMED} more" if len(found) > _NAMED else ""
                named = ", ".join(found[:_NAMED])
                notes.append(f"{tree.file.name}: links {outcome}: {named}{more}")
        return cls({name: some for name, some in parts.items() if some}, tuple(notes), missing)


@dataclass(frozen=True, eq=False)
class _Reader:
    """Reads elements of one URDF, every mesh file once."""

    file: Path
    packages: Mapping[str, Path]
    meshes: dict[tuple[Path, tuple[float, ...]], Mesh] = field(default_factory=dict)
    missing: set[str] = field(default_factory=set)

    def read(self, link: ET.Element, tag: str) -> tuple[tuple[Part, ...], str]:
        """The readable elements of a link, and why the first that is not cannot be read."""
        parts, why = [], ""
        for element in link.findall(tag):
            try:
                parts.append(self._part(element))
            except _UnreadableError as error:
                why = why or str(error)
        return tuple(parts), why

    def _part(self, element: ET.Element) -> Part:
        geometry = element.find("geometry")
        if geometry is None or not len(geometry):
            raise _UnreadableError("no geometry")
        try:
            return Part(self._shape(geometry[0]), placement(element))
        except ValueError as error:
            raise _UnreadableError(str(error)) from None

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
        raise _UnreadableError(f"unknown geometry {shown(element.tag)}")

    def _mesh(self, name: str, scale: tuple[float, ...]) -> Mesh:
        file = None
        try:
            file = mesh_file(name, self.file, self.packages)
        except MissingPackageError as error:
            self.missing.add(error.message)
        if file is None:
            raise _UnreadableError(f"mesh {shown(name)} was not found")
        if (file, scale) not in self.meshes:
            self.meshes[file, scale] = Mesh(_loaded(file, scale))
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


def _loaded(file: Path, scale: tuple[float, ...]) -> Any:
    import coal

    try:
        mesh = coal.MeshLoader(coal.NODE_TYPE.BV_OBBRSS).load(str(file), np.array(scale))
    except (ValueError, RuntimeError):
        mesh = None
    if mesh is None or not mesh.num_tris or not np.all(np.isfinite(mesh.vertices())):
        raise _UnreadableError(f"{file.name} is no mesh that can be read")
    return mesh


def _lengths(element: ET.Element, key: str, count: int) -> tuple[float, ...]:
    values = numbers(element, key, count)
    if min(values) <= 0:
        raise _UnreadableError(f"{key} is {shown(element.get(key))}")
    return values
