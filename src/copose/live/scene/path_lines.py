"""The object's path in the scene: a line through its waypoints, each a small frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import viser

from copose.poses import Pose
from copose.viewer.names import node
from copose.viewer.nodes.colors import rgb

# Colour of the line.
_COLOUR = "#2F8FD0"
# Its thickness, pixels.
_LINE = 3.0
# Length of a waypoint's axes, as a share of the scene.
_AXIS = 0.07
# Radius of them and of the ball between them, as shares of their length.
_THICK = 0.05
_BALL = 0.16


class PathDrawing:
    """The path of a page: nodes ``/path/line`` and ``/path/waypoints/1``, ``2`` and so on."""

    def __init__(self, scene: viser.SceneApi, waypoints: Sequence[Pose], size: float) -> None:
        """Draw a path.

        Args:
            scene: where.
            waypoints: of the object's centre of mass in the world.
            size: of the scene, m.
        """
        self._waypoints: list[Pose] = []
        self._top = scene.add_frame(node("path"), show_axes=False)
        length = _AXIS * size
        self._frames = [
            scene.add_frame(
                node("path", "waypoints", str(k + 1)), axes_length=length,
                axes_radius=_THICK * length, origin_radius=_BALL * length,
                origin_color=rgb(_COLOUR),
            )
            for k in range(len(waypoints))
        ]  # fmt: skip
        self._line = scene.add_line_segments(
            node("path", "line"), _segments(waypoints), rgb(_COLOUR), thickness=_LINE,
            thickness_units="screen",
        )  # fmt: skip
        self.place(waypoints)

    def see(self, visible: bool) -> None:
        """Show or hide it."""
        self._top.visible = visible

    def place(self, waypoints: Sequence[Pose]) -> None:
        """Draw the same number of waypoints where they are now."""
        known = [each is other for each, other in zip(waypoints, self._waypoints, strict=False)]
        if known and all(known):
            return
        self._waypoints = list(waypoints)
        for frame, pose in zip(self._frames, waypoints, strict=True):
            frame.position, frame.wxyz = pose.position, pose.quaternion
        self._line.points = _segments(waypoints)


def _segments(waypoints: Sequence[Pose]) -> np.ndarray:
    """From each waypoint to the next, (n − 1, 2, 3)."""
    points = np.array([pose.position for pose in waypoints], dtype=np.float32)
    return np.stack([points[:-1], points[1:]], axis=1)
