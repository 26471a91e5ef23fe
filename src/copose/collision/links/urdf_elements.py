"""The collision and visual elements of a URDF as shapes of its links."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from copose.collision.links.link_geometry import Geometry, Looks, listed, only_visual
from copose.collision.shapes.mesh_files import MeshFile, UnreadableError, loaded_mesh
from copose.collision.shapes.meshes import Mesh
from copose.collision.shapes.primitives import Primitive
from copose.collision.shapes.solids import Part
from copose.errors import InputError, shown
from copose.robots.files.file_paths import PACKAGE, MissingPackageError, resolve
from copose.robots.files.urdf_tree import numbers, origin_pose
from copose.robots.robot import Robot


def urdf_geometry(robot: Robot, measured: bool = False) -> Geometry:
    """The collision elements of a URDF's links, or what stands in for them.

    Visual elements stand in where a link's collision elements cannot be read, and where the URDF
    has no collision elements at all.
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
        stand_in = "tested by visual geometry, for no collision geometry can be read"
        notes.append(f"{tree.file.name}: links {stand_in}: {listed(instead)}")
    return Geometry(parts, faults, notes, missing, reader.files)


def urdf_looks(robot: Robot) -> Looks:
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
    """A reader of elements of one URDF, which reads every mesh file once."""

    file: Path
    packages: Mapping[str, Path]  # folders of packages by name
    mesh: Callable[[Path, tuple[float, ...]], Mesh]  # makes the surface of a mesh file at a scale
    meshes: dict[tuple[Path, tuple[float, ...]], Mesh] = field(default_factory=dict)  # those made
    # Of each package that was not found, where it was looked for.
    missing: set[str] = field(default_factory=set)
    files: dict[str, Path] = field(default_factory=dict)  # that were found, by name

    def read(self, link: ET.Element, tag: str) -> tuple[tuple[Part, ...], str]:
        """The readable elements of a link, and the reason why the first other cannot be read."""
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
        """The shape of an element in its link's frame; None for one without any extent."""
        geometry = element.find("geometry")
        if geometry is None or not len(geometry):
            raise UnreadableError("no geometry")
        try:
            primitive = _primitive(geometry[0])
            shape = self._mesh(geometry[0]) if primitive is None else primitive
            pose = origin_pose(element)
        except ValueError as error:
            raise UnreadableError(str(error)) from None
        if primitive is not None and min(primitive.size) == 0:
            if any(primitive.size):
                raise UnreadableError(f"a {primitive.kind} has no extent: {shown(primitive.size)}")
            return None
        return Part(shape, pose)

    def _mesh(self, element: ET.Element) -> Mesh:
        """The surface that a ``<mesh>`` names."""
        if element.tag != "mesh":
            raise UnreadableError(f"unknown geometry {shown(element.tag)}")
        scale, name, file = numbers(element, "scale", 3, "1 1 1"), element.get("filename", ""), None
        try:
            file = mesh_file(name, self.file, self.packages)
        except MissingPackageError as error:
            self.missing.add(error.message)
        if file is None:
            raise UnreadableError(f"mesh {shown(name)} was not found")
        self.files[name] = file
        if (file, scale) not in self.meshes:
            self.meshes[file, scale] = self.mesh(file, scale)
        return self.meshes[file, scale]


def mesh_file(name: str, urdf: Path, packages: Mapping[str, Path]) -> Path | None:
    """The mesh file that a URDF names, or None where it is not there.

    Args:
        name: ``package://…``, ``model://…``, ``file://…``, or a path relative to the URDF.
        urdf: the URDF's path; a package that it lies in, or beside, is found without ROS.
        packages: folders of packages by name, looked into first.

    Raises:
        MissingPackageError: no folder was found for the package; the message names those tried.
    """
    rest = name.removeprefix("model://")
    name = PACKAGE + rest if rest != name else name.removeprefix("file://")
    try:
        path = resolve(name, urdf.parent, packages, urdf.parents)
        return path if path.is_file() else None
    except MissingPackageError:
        raise
    except (InputError, OSError, ValueError, RuntimeError):
        # Raised by pathlib for unknown users, zero bytes and endless names.
        return None


def _primitive(element: ET.Element) -> Primitive | None:
    """The primitive that an element of ``<geometry>`` describes; None for another element."""
    match element.tag:
        case "box":
            return Primitive("box", _lengths(element, "size", 3))
        case "sphere":
            return Primitive("sphere", _lengths(element, "radius", 1))
        case "cylinder" | "capsule" as kind:
            size = (*_lengths(element, "radius", 1), *_lengths(element, "length", 1))
            return Primitive(kind, size)
    return None


def _lengths(element: ET.Element, key: str, count: int) -> tuple[float, ...]:
    """Lengths of an attribute, m, none below zero."""
    values = numbers(element, key, count)
    if min(values) < 0:
        raise UnreadableError(f"{key} is {shown(element.get(key))}")
    return values
