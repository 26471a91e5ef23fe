"""The object's path in the scene: a line through its waypoints, each a small frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import viser

from copose.poses import Pose
from copose.viewer.names import node, rgb


@dataclass(frozen=True)
class PathLook:
    """Look of the path in the scene."""

    colour: str = "#2F8FD0"
    line: float = 3.0  # thickness of the line, pixels
    axis: float = 0.07  # length of a waypoint's axes, as a share of the scene
    thick: float = 0.05  # radius of the axes, as a share of their length
    ball: float = 0.16  # radius of the ball between them, alike


class PathDrawing:
    """The path of a page: nodes ``/path/line`` and ``/path/waypoints/1``, ``2`` and so on."""

    def __init__(
        self, scene: viser.SceneApi, waypoints: Sequence[Pose], size: float,
        look: PathLook = PathLook(),
    ) -> None:  # fmt: skip
        """Draw a path.

        Args:
            scene: the scene.
            waypoints: of the object's centre of mass in the world.
            size: size of the scene, m.
            look: its look.
        """
        self._waypoints: list[Pose] = []
        self._top = scene.add_frame(node("path"), show_axes=False)
        length = look.axis * size
        self._frames = [
            scene.add_frame(
                node("path", "waypoints", str(k + 1)), axes_length=length,
                axes_radius=look.thick * length, origin_radius=look.ball * length,
                origin_color=rgb(look.colour),
            )
            for k in range(len(waypoints))
        ]  # fmt: skip
        self._line = scene.add_line_segments(
            node("path", "line"), _segments(waypoints), rgb(look.colour), thickness=look.line,
            thickness_units="screen",
        )  # fmt: skip
        self.place(waypoints)

    def see(self, visible: bool) -> None:
        """Show or hide the path."""
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
    """Segments from each waypoint to the next, (n − 1, 2, 3)."""
    points = np.array([pose.position for pose in waypoints], dtype=np.float32)
    return np.stack([points[:-1], points[1:]], axis=1)
