"""The points of a study in the scene: a cloud for each status, coloured by value."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import viser

from copose.live.plots.svg import PLOT, ColorScale
from copose.live.studies.study_points import Marks, StudyPoints
from copose.poses import Array
from copose.report.look import LOOK
from copose.viewer.names import node, rgb


@dataclass(frozen=True)
class CloudLook:
    """Sizes and colours of marks."""

    share: float = 0.4  # radius of a mark, as a share of the distance of marks
    least: float = 0.003  # radius, as a share of the scene, at least
    most: float = 0.016  # and at most
    small: float = 0.55  # radius of infeasible points, as a share of the others
    infeasible: str = "#A8A8A8"
    failed: str = LOOK.over
    ring: float = 1.5  # radius of the ball around the chosen point, as a share of a mark
    opacity: float = 0.45  # of this ball


CLOUD = CloudLook()


class PointCloud:
    """Nodes ``/study/solved``, ``/study/infeasible``, ``/study/failed`` and ``/study/chosen``."""

    def __init__(
        self,
        scene: viser.SceneApi,
        marks: Marks,
        size: float,
        *,
        standing: bool,
        look: CloudLook = CLOUD,
    ) -> None:
        """A cloud without points yet; its marks stand on their places, or have them as centres."""
        self._scene, self._look = scene, look
        size = max(size, float(np.ptp(marks.places, axis=0).max()))
        self._radius = float(
            np.clip(look.share * marks.distance, look.least * size, look.most * size)
        )
        if standing:
            # The grid of the ground would be drawn over marks that it cuts in halves.
            marks = replace(marks, places=marks.places + np.array([0.0, 0.0, self._radius]))
        self.marks = marks
        self._seen = np.zeros(len(marks.places), dtype=bool)
        self._top = scene.add_frame(node("study"), show_axes=False)
        self._chosen = scene.add_icosphere(
            node("study", "chosen"), look.ring * self._radius, color=rgb(PLOT.present),
            opacity=look.opacity, cast_shadow=False, receive_shadow=False, visible=False,
        )  # fmt: skip

    def show(self, points: StudyPoints, scale: ColorScale, part: str) -> None:
        """Draw a part of the points, those that are solved in the colours of their values."""
        look, numbers = self._look, self.marks.points
        self._seen = points.seen(numbers, part)
        statuses = points.statuses[numbers]
        solved = scale.colors(np.nan_to_num(points.values[numbers], nan=-np.inf))
        self._draw("solved", statuses == "solved", solved, 1.0)
        self._draw("infeasible", statuses == "infeasible", rgb(look.infeasible), look.small)
        self._draw("failed", statuses == "failed", rgb(look.failed), 1.0)

    def hit(self, origin: Array, direction: Array) -> int | None:
        """The number of the point that a ray hits; None where it hits none that is shown."""
        return self.marks.hit(origin, direction, self._radius, self._seen)

    def choose(self, point: int | None) -> None:
        """Mark the place of a point; None marks none."""
        place = None if point is None else self.marks.at(point)
        self._chosen.visible = place is not None
        if place is not None:
            self._chosen.position = place

    def remove(self) -> None:
        """Take all points out of the scene."""
        self._top.remove()

    def _draw(self, status: str, shown: np.ndarray, colors: object, share: float) -> None:
        """Draw the points of a status; none draws nothing."""
        shown = shown & self._seen
        if not shown.any():
            return
        self._scene.add_point_cloud(
            node("study", status),
            self.marks.places[shown].astype(np.float32),
            colors[shown] if isinstance(colors, np.ndarray) else colors,  # type: ignore[arg-type]
            # Viser's size of a point is its radius.
            point_size=share * self._radius,
            point_shape="diamond" if status == "failed" else "circle",
            precision="float32",
        )
