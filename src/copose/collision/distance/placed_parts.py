"""Parts of solids in the frames of their carriers, and their placements for coal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from copose.collision.carriers import Placements
from copose.collision.distance.segments import Segments
from copose.collision.shapes.solids import Shape
from copose.poses import Array, Pose


@dataclass(frozen=True, eq=False)
class PlacedPart:
    """A part of a solid, in the frame of the solid's carrier."""

    shape: Shape
    pose: Pose  # the shape's frame in the carrier's
    carrier: int  # number of the carrier

    @property
    def hull(self) -> tuple[Array, float]:
        """Points in the carrier's frame, (n, 3), and a distance, m: all within it of their convex
        hull holds the part.
        """
        points, beyond = self.shape.hull
        return points @ self.pose.rotation.T + self.pose.position, beyond

    def at(self, where: Placements) -> tuple[Array, Array]:
        """Rotation and position in the world, in one configuration."""
        R = where.rotations[self.carrier]
        return R @ self.pose.rotation, R @ self.pose.position + where.positions[self.carrier]


class PartPoses:
    """The placements of parts in one configuration, as coal takes them.

    Attributes:
        where: the placements of the carriers.
    """

    def __init__(self, where: Placements) -> None:
        self.where = where
        self._known: dict[int, Any] = {}

    def __call__(self, part: PlacedPart) -> Any:
        """The placement of a part."""
        import coal

        if id(part) not in self._known:
            self._known[id(part)] = coal.Transform3s(*part.at(self.where))
        return self._known[id(part)]


def ball_round(parts: Sequence[PlacedPart]) -> tuple[Array, float]:
    """Centre, (3,), and radius, m, of a ball round parts, about the middle of their extent."""
    points, reach = [], []
    for part in parts:
        corners, beyond = part.hull
        points.append(corners)
        reach += [beyond] * len(corners)
    x, r = np.vstack(points), np.array(reach)[:, None]
    centre = ((x - r).min(axis=0) + (x + r).max(axis=0)) / 2
    return centre, float((np.linalg.norm(x - centre, axis=1) + r[:, 0]).max())


def segments_of(parts: Sequence[PlacedPart | None]) -> Segments:
    """Segments in the frames of their carriers that round parts are within a radius of; points at
    the origin for what is None, (s, 3) each.
    """
    ends = np.zeros((len(parts), 2, 3))
    for k, part in enumerate(parts):
        if part is not None:
            ends[k] = part.hull[0]
    return Segments(ends[:, 0], ends[:, 1] - ends[:, 0])
