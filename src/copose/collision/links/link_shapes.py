"""The shapes of a robot's links, whatever the format of its file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from copose.collision.links.link_geometry import Geometry, LinkPair, Looks, listed
from copose.collision.links.mjcf_geoms import kept_apart, mjcf_geometry, mjcf_looks
from copose.collision.links.urdf_elements import urdf_geometry, urdf_looks
from copose.collision.shapes.solids import Part
from copose.robots.files.tree import Tree
from copose.robots.robot import Robot


@dataclass(frozen=True)
class LinkFormat:
    """The readers of links' shapes in one format of robot files."""

    elements: str  # what gives a link its shape in such a file, in words
    # Shapes to be tested, of a robot; the flag tells that only their sizes are needed, for which
    # meshes are read in a third of the time.
    geometry: Callable[[Robot, bool], Geometry]
    looks: Callable[[Robot], Looks]  # shapes by which a robot's links are shown
    # Pairs of links that a file itself keeps from touching, by what in it does so.
    kept_apart: Callable[[Tree], Mapping[str, set[LinkPair]]]


LINK_FORMATS = {
    "urdf": LinkFormat(
        "<collision> or <visual> elements", urdf_geometry, urdf_looks, lambda _tree: {}
    ),
    "mjcf": LinkFormat("geoms", mjcf_geometry, mjcf_looks, kept_apart),
}


@dataclass(frozen=True, eq=False)
class LinkShapes:
    """The shapes of a robot's links."""

    parts: dict[str, tuple[Part, ...]]  # of the links that have any, placed in the link's frame
    faults: dict[str, str]  # of each link whose shape cannot be read, the reason
    notes: tuple[str, ...]  # what stands in for shapes, and what is left out
    # Of each package that was not found, where it was looked for; among the notes too.
    missing: tuple[str, ...]
    large: tuple[str, ...]  # a note on the links that are larger than any robot's, if there are any

    @classmethod
    def of(cls, robot: Robot, *, measured: bool = False, most: float = 10.0) -> LinkShapes:
        """Read the shapes of a robot's links.

        Args:
            robot: its file, read.
            measured: whether only their sizes are needed, for which meshes are read in a third of
                the time.
            most: length beyond which a shape is no robot's, m; most often it is a mesh in other
                units.
        """
        tree = robot.tree
        geometry = LINK_FORMATS[tree.format].geometry(robot, measured)
        sizes = {name: _size(parts) for name, parts in geometry.parts.items()}
        large = {name: f"{size:.3g} m" for name, size in sizes.items() if size > most}
        too_large = f"{tree.file.name}: links larger than any robot's: {listed(large)}"
        return cls(
            parts={name: parts for name, parts in geometry.parts.items() if parts},
            faults=geometry.faults,
            notes=tuple(geometry.notes),
            missing=geometry.missing,
            large=(too_large,) if large else (),
        )


def _size(parts: tuple[Part, ...]) -> float:
    """The longest side of the box round shapes in their link's frame, m."""
    ends = []
    for part in parts:
        points, radius = part.shape.hull
        placed = points @ part.placement.rotation.T + part.placement.position
        ends += [placed.min(axis=0) - radius, placed.max(axis=0) + radius]
    return float(np.ptp(ends, axis=0).max()) if ends else 0.0
