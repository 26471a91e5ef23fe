"""The camera from which a page first sees a cell."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from copose.poses import Array, rotation_rows
from copose.report.geometry.camera import best_view
from copose.report.geometry.link_bodies import LinkBody
from copose.results import Posture
from copose.robots import Arm
from copose.viewer.looks import Look

if TYPE_CHECKING:
    from viser import InitialCameraConfig

# Angle that a page shows from its lower to its upper edge, rad.
_ANGLE = np.radians(35.0)
# What is left free around the cell, as a share of it.
_MARGIN = 1.12
# Width of a page over its height, at least: what is beside is hidden by nothing.
_WIDE = 1.2
# Directions in which a link's hull reaches as far as the link does.
_CUBE = np.array([d for d in np.ndindex(3, 3, 3) if d != (1, 1, 1)]) - 1.0


@dataclass(frozen=True, eq=False)
class Camera:
    """An eye in the world.

    Attributes:
        position: where it is, m, (3,).
        target: what it looks at, m, (3,).
        up: the direction that is up in the picture, (3,).
        angle: that the picture shows from its lower to its upper edge, rad.
    """

    position: Array
    target: Array
    up: Array
    angle: float

    @property
    def axes(self) -> Array:
        """Unit vectors to the right, up and towards the eye, (3, 3)."""
        toward = self.position - self.target
        toward = toward / np.linalg.norm(toward)
        right = np.cross(self.up, toward)
        right /= np.linalg.norm(right)
        return np.array([right, np.cross(toward, right), toward])

    def place(self, initial: InitialCameraConfig) -> None:
        """Make a page start with it."""
        initial.position = self.position
        initial.look_at = self.target
        initial.up = self.up
        initial.fov = self.angle


def first_camera(
    posture: Posture, arms: Sequence[Arm], looks: Sequence[Look], points: Array, *, planar: bool
) -> Camera:
    """An eye that sees a posture as pictures do: hands and object above all; the plane from above.

    Args:
        posture: what is to be seen.
        arms: the arms.
        looks: of their links.
        points: of the object and of what is to be in the picture, (k, 3).
        planar: whether the arms move in the x-y plane.
    """
    if planar:
        right, up, toward = np.eye(3)
        around = np.vstack([points, *(placed(look, posture, arms) for look in looks)])
    else:
        bodies = _bodies(posture, arms, looks)
        right, up, toward = best_view([(bodies, points)]).axes
        around = np.vstack([points, *(body.points for body in bodies)])
    seen = around @ np.array([right, up, toward]).T
    low, high = seen.min(axis=0), seen.max(axis=0)
    half = np.maximum(np.ptp(seen[:, :2], axis=0) / (2 * _WIDE, 2), 0.05).max()
    middle = (low + high) / 2
    away = _MARGIN * half / np.tan(_ANGLE / 2) + (high - low)[2] / 2
    target = middle @ np.array([right, up, toward])
    above = np.array([0.0, 1.0, 0.0]) if planar else np.array([0.0, 0.0, 1.0])
    return Camera(target + away * toward, target, above, float(_ANGLE))


def placed(look: Look, posture: Posture, arms: Sequence[Arm]) -> Array:
    """Corners of a link in the world, (v, 3)."""
    record = posture.arms[arms[look.carrier.arm].name]
    k = look.carrier.joint + 1
    rotation = np.array(rotation_rows(record.quaternions[k]))
    return np.asarray(look.vertices @ rotation.T + np.array(record.skeleton[k]))


def _bodies(posture: Posture, arms: Sequence[Arm], looks: Sequence[Look]) -> list[LinkBody]:
    """The links as rough convex bodies."""
    found = []
    for look in looks:
        arm = arms[look.carrier.arm]
        corners = placed(look, posture, arms)
        corners = corners[np.unique((corners @ _CUBE.T).argmax(axis=0))]
        with contextlib.suppress(QhullError, ValueError):
            hull = ConvexHull(corners)
            found.append(
                LinkBody(
                    arm=None if look.shared else arm.name,
                    frame=look.carrier.joint + 1,
                    last=look.carrier.joint == arm.n - 1,
                    faces=corners[hull.simplices],
                    normals=hull.equations[:, :3],
                )
            )
    return found
