"""Slices of ellipsoids as balls that are turned and stretched."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array, Pose
from copose.report.geometry.slices import Slice


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
    def of(cls, part: Slice, thin: float = 0.02) -> Stretch:
        """The stretch of a ball that makes it a slice.

        Args:
            part: the slice.
            thin: thickness of a flat slice, as a share of its longest semi-axis.
        """
        ellipsoid, world = part.ellipsoid, list(part.world)
        columns = np.zeros((3, 3))
        columns[np.ix_(world, range(len(world)))] = ellipsoid.axes.T
        other_axes = [axis for axis in range(3) if axis not in world]
        columns[other_axes, range(len(world), 3)] = 1.0
        if np.linalg.det(columns) < 0:
            columns[:, 2] *= -1
        thickness = thin * float(ellipsoid.radii[0])
        radii = np.append(ellipsoid.radii, [thickness] * len(other_axes))
        return cls(Pose.from_rotation(columns).quaternion, radii)
