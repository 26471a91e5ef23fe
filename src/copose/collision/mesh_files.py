"""Surfaces in mesh files, in metres."""

from __future__ import annotations

import contextlib
import math
import xml.etree.ElementTree as ET
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from copose.collision.solids import Mesh
from copose.errors import shown


class UnreadableError(Exception):
    """Why an element gives no shape."""


class MeshFile(Mesh):
    """A surface in a file, which is read when it is asked for.

    Attributes:
        file: where it is.
        scale: of its coordinates along x, y and z, beside the unit that the file declares.
    """

    file: Path
    scale: tuple[float, ...]

    def __init__(self, file: Path, scale: tuple[float, ...]) -> None:
        """Nothing is read yet."""
        # Frozen, as all shapes are.
        self.__dict__.update(file=file, scale=scale)

    @cached_property
    def coal(self) -> Any:
        """The surface.

        Raises:
            UnreadableError: the file holds none.
        """
        return loaded_mesh(self.file, self.scale, measured=True)


def loaded_mesh(file: Path, scale: tuple[float, ...], measured: bool) -> Any:
    """The surface in a mesh file, for coal.

    Args:
        file: where it is.
        scale: of its coordinates along x, y and z, beside the unit that the file declares.
        measured: whether it is but measured, for which it is read in a third of the time.

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

    coal passes over it, and over the axis that points up; ROS heeds the first and not the second.
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
