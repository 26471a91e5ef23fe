"""The shapes of a robot's links, by whatever its file is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.collision.geometry import listed
from copose.collision.mjcf_geometry import mjcf_geometry
from copose.collision.solids import Part
from copose.collision.urdf_geometry import urdf_geometry
from copose.robots.robot import Robot

# Lengths, m, beyond which a shape is no robot's: most often of a mesh in other units.
_LARGE = 10.0


@dataclass(frozen=True, eq=False)
class LinkShapes:
    """The shapes of a robot's links.

    Attributes:
        parts: of the links that have any, placed in the link's frame.
        faults: of the links whose shape cannot be read, why.
        notes: what stands in for shapes, and what is left out.
        missing: on packages that were not found, where was looked; among the notes too.
        large: which are larger than any robot's.
    """

    parts: dict[str, tuple[Part, ...]]
    faults: dict[str, str]
    notes: tuple[str, ...]
    missing: tuple[str, ...]
    large: tuple[str, ...]

    @classmethod
    def of(cls, robot: Robot, *, measured: bool = False) -> LinkShapes:
        """The shapes of a robot's links.

        Args:
            robot: read.
            measured: whether they are but measured, for which meshes are read in a third of the
                time.
        """
        tree = robot.tree
        found = mjcf_geometry(tree) if tree.model else urdf_geometry(robot, measured=measured)
        sizes = {name: _size(some) for name, some in found.parts.items()}
        large = {name: f"{size:.3g} m" for name, size in sizes.items() if size > _LARGE}
        too_large = f"{tree.file.name}: links larger than any robot's: {listed(large)}"
        return cls(
            parts={name: some for name, some in found.parts.items() if some},
            faults=found.faults,
            notes=tuple(found.notes),
            missing=found.missing,
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
