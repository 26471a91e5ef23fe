"""Slices of ellipsoids as balls that are turned and stretched."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array, Pose
from copose.report.geometry.slices import Slice

# Thickness of a flat slice, as a share of its longest semi-axis.
_THIN = 0.02


@dataclass(frozen=True, eq=False)
class Stretch:
    """A ball of radius 1, stretched along axes of its own, which are turned in the world.

    Attributes:
        quaternion: of its axes in the world, [w, x, y, z].
        radii: its semi-axes along them, (3,), in the unit of the ellipsoid; of coordinates that a
            slice does not have next to nothing.
    """

    quaternion: Array
    radii: Array

    @classmethod
    def of(cls, part: Slice) -> Stretch:
        """The ball that becomes a slice."""
        ellipsoid, world = part.ellipsoid, list(part.world)
        columns = np.zeros((3, 3))
        columns[np.ix_(world, range(len(world)))] = ellipsoid.axes.T
        others = [axis for axis in range(3) if axis not in world]
        columns[others, range(len(world), 3)] = 1.0
        if np.linalg.det(columns) < 0:
            columns[:, 2] *= -1
        thin = _THIN * float(ellipsoid.radii[0])
        radii = np.append(ellipsoid.radii, [thin] * len(others))
        return cls(Pose.from_rotation(columns).quaternion, radii)


def circle(count: int = 72) -> Array:
    """A circle of radius 1 about z as segments, (count, 2, 3)."""
    angles = np.linspace(0, 2 * np.pi, count + 1)
    points = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(count + 1)])
    return np.stack([points[:-1], points[1:]], axis=1)
