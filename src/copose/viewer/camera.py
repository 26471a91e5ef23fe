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


@dataclass(frozen=True)
class CameraOptions:
    """The first view of a cell."""

    angle: float = np.radians(35.0)  # rad, from the lower to the upper edge of a page
    margin: float = 1.12  # distance of the eye by that at which the cell fills the page
    aspect: float = 1.2  # width of a page over its height, at least
    least: float = 0.05  # m, half the height of what is seen


@dataclass(frozen=True, eq=False)
class Camera:
    """An eye in the world."""

    position: Array  # of the eye, m, (3,)
    target: Array  # the point that it looks at, m, (3,)
    up: Array  # the direction that is up in the picture, (3,)
    angle: float  # that the picture shows from its lower to its upper edge, rad

    @property
    def axes(self) -> Array:
        """Unit vectors to the right, up and towards the eye, (3, 3)."""
        toward = self.position - self.target
        toward = toward / np.linalg.norm(toward)
        right = np.cross(self.up, toward)
        right /= np.linalg.norm(right)
        return np.array([right, np.cross(toward, right), toward])

    def place(self, initial: InitialCameraConfig) -> None:
        """Make a page start with this camera."""
        initial.position = self.position
        initial.look_at = self.target
        initial.up = self.up
        initial.fov = self.angle


def first_camera(
    posture: Posture,
    arms: Sequence[Arm],
    looks: Sequence[Look],
    points: Array,
    *,
    planar: bool,
    options: CameraOptions = CameraOptions(),
) -> Camera:
    """An eye that sees a posture, and points, m, (k, 3), as pictures do: hands and object above
    all; the plane from above.
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
    half = np.maximum(np.ptp(seen[:, :2], axis=0) / (2 * options.aspect, 2), options.least).max()
    middle = (low + high) / 2
    away = options.margin * half / np.tan(options.angle / 2) + (high - low)[2] / 2
    target = middle @ np.array([right, up, toward])
    above = np.array([0.0, 1.0, 0.0]) if planar else np.array([0.0, 0.0, 1.0])
    return Camera(target + away * toward, target, above, float(options.angle))


def placed(look: Look, posture: Posture, arms: Sequence[Arm]) -> Array:
    """Corners of a link in the world, (v, 3)."""
    record = posture.arms[arms[look.carrier.arm].name]
    k = look.carrier.joint + 1
    rotation = np.array(rotation_rows(record.quaternions[k]))
    return np.asarray(look.vertices @ rotation.T + np.array(record.skeleton[k]))


def _bodies(posture: Posture, arms: Sequence[Arm], looks: Sequence[Look]) -> list[LinkBody]:
    """The links as rough convex bodies."""
    # Directions in which a link's hull reaches as far as the link does.
    cube = np.array([place for place in np.ndindex(3, 3, 3) if place != (1, 1, 1)]) - 1.0
    bodies = []
    for look in looks:
        arm = arms[look.carrier.arm]
        corners = placed(look, posture, arms)
        corners = corners[np.unique((corners @ cube.T).argmax(axis=0))]
        with contextlib.suppress(QhullError, ValueError):
            hull = ConvexHull(corners)
            bodies.append(
                LinkBody(
                    arm=None if look.shared else arm.name,
                    frame=look.carrier.joint + 1,
                    last=look.carrier.joint == arm.n - 1,
                    faces=corners[hull.simplices],
                    normals=hull.equations[:, :3],
                )
            )
    return bodies
