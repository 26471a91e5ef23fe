"""Surfaces in mesh files, in metres."""

from __future__ import annotations

import contextlib
import hashlib
import math
import xml.etree.ElementTree as ET
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from copose.collision.shapes.meshes import Mesh
from copose.errors import shown


class UnreadableError(Exception):
    """The reason why an element of a robot's file gives no shape."""


class MeshFile(Mesh):
    """A surface in a file, which is read when its triangles are needed.

    Attributes:
        file: its path.
        scale: factors of its coordinates along x, y and z, besides the unit that the file declares.
    """

    file: Path
    scale: tuple[float, ...]

    def __init__(self, file: Path, scale: tuple[float, ...]) -> None:
        """Name the file without reading it."""
        # All shapes are frozen.
        self.__dict__.update(file=file, scale=scale)

    @cached_property
    def coal(self) -> Any:
        """The surface.

        Raises:
            UnreadableError: the file holds none.
        """
        return loaded_mesh(self.file, self.scale, measured=True)

    @property
    def fingerprint(self) -> bytes:
        """Equal for surfaces that look alike; the file is read, but no surface is built."""
        return repr(self.scale).encode() + _content(self.file, *_stamp(self.file))


def loaded_mesh(file: Path, scale: tuple[float, ...], measured: bool) -> Any:
    """The surface in a mesh file, for coal.

    Args:
        file: its path.
        scale: factors of its coordinates along x, y and z, besides the unit that the file declares.
        measured: whether only its size is needed, for which it is read in a third of the time.

    Raises:
        UnreadableError: the file holds none.
    """
    import coal

    factors = np.array(scale) * _unit(file)
    try:
        boxes = coal.NODE_TYPE.BV_AABB if measured else coal.NODE_TYPE.BV_OBBRSS
        mesh = coal.MeshLoader(boxes).load(str(file), factors)
    except (ValueError, RuntimeError):
        mesh = None
    if mesh is None or not mesh.num_tris or not np.all(np.isfinite(mesh.vertices())):
        raise UnreadableError(f"{file.name} is no mesh that can be read")
    return mesh


def _unit(file: Path) -> float:
    """The unit of length that a Collada file declares, m; other formats have none.

    coal ignores the unit and the upward axis of a file; ROS obeys the unit and ignores the axis.
    """
    text = "1"
    with contextlib.suppress(ET.ParseError, OSError), file.open("rb") as content:
        root = ""
        for event, element in ET.iterparse(content, ("start", "end")):
            tag = element.tag.rpartition("}")[2]
            root = root or tag
            if root != "COLLADA":
                break
            if event == "end" and tag == "asset":
                unit = element.find("{*}unit")
                text = unit.get("meter", "1") if unit is not None else "1"
                break
    with contextlib.suppress(ValueError):
        if 0 < float(text) < math.inf:
            return float(text)
    raise UnreadableError(f"the unit of {file.name} is {shown(text)}; so many metres are needed")


def _stamp(file: Path) -> tuple[int, int]:
    """The time of a file's last change, ns, and its size, bytes."""
    try:
        state = file.stat()
    except OSError:
        return 0, 0
    return state.st_mtime_ns, state.st_size


@lru_cache(maxsize=1024)
def _content(file: Path, _changed: int, _size: int) -> bytes:
    """A digest of a file's content; empty where it cannot be read."""
    try:
        return hashlib.blake2b(file.read_bytes(), digest_size=16).digest()
    except OSError:
        return b""
