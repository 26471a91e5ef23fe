"""Rigid bodies that may touch, and the shapes that they consist of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from copose.collision.carriers import Carrier
from copose.collision.shapes.meshes import Mesh
from copose.collision.shapes.primitives import Primitive
from copose.poses import Pose

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
    """The links of all arms as solids.

    Attributes:
        solids: links that have a shape; robot by robot the static ones, then those of its arms.
        mounts: (arm, name) of the static solids that an arm's first joint hangs on.
        ignored: names of two solids that nothing tests.
        notes: which shapes could not be read, and what else is doubtful.
    """

    solids: tuple[Solid, ...]
    mounts: frozenset[tuple[int, str]] = frozenset()
    ignored: frozenset[frozenset[str]] = frozenset()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class LinkLook:
    """Shapes by which a link may be shown."""

    name: str
    carrier: Carrier  # what moves it
    placement: Pose  # the link's frame in the carrier's
    # Shapes in the link's frame, the best first; a mesh file need not be readable.
    choices: tuple[tuple[Part, ...], ...]
    shared: bool = False  # whether several arms stand on it
