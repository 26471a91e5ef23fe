"""A motion in the world: arms and object at some of its times, and the object's way."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox
from mpl_toolkits.mplot3d.proj3d import proj_transform

from copose.poses import Array
from copose.problem import SPACES
from copose.report import style
from copose.report.charts import legends
from copose.report.geometry.camera import best_view
from copose.report.geometry.link_bodies import LinkBodies
from copose.report.geometry.obstacles import bodies
from copose.report.geometry.view import View, frame, roomy
from copose.report.scene import planar as planar_scene
from copose.report.scene import spatial as spatial_scene
from copose.report.scene.polygons import Polygons
from copose.results import Knot, Motion

# How dark the first ghost and the last are.
_FAINT, _STRONG = 0.18, 0.55
# Times that axes in space are fitted to their place: labels do not grow with them.
_FITS = 3


@dataclass(frozen=True, eq=False)
class MotionScene:
    """Axes in which all postures of a motion have room.

    Attributes:
        motion: what moves.
        knots: its postures.
        planar: whether it moves in the plane.
        near: the box around arms and objects, (2, d).
        links: bodies of the arms.
        view: where it is seen from.
        low: the least coordinates of the axes; ``high`` the largest.
    """

    motion: Motion
    knots: tuple[Knot, ...]
    planar: bool
    near: Array
    links: LinkBodies
    view: View
    low: Array
    high: Array

    @classmethod
    def of(cls, motion: Motion) -> MotionScene:
        """The scene of a motion that has knots."""
        assert motion.knots is not None
        planar = SPACES[motion.problem.space].planar
        scene = planar_scene if planar else spatial_scene
        points = np.vstack([scene.posture_points(knot, motion) for knot in motion.knots])
        links, view = LinkBodies((), frozenset()), View()
        if not planar:
            links, ends = LinkBodies.of(motion.problem), (motion.knots[0], motion.knots[-1])
            around = [links.placed(knot) for knot in ends]
            points = np.vstack([points, *(body.points for some in around for body in some)])
            things = [spatial_scene.object_points(knot, motion) for knot in ends]
            view = best_view(list(zip(around, things, strict=True)))
        near = np.array([points.min(axis=0), points.max(axis=0)])
        known = np.vstack([near, *(body.points for body in bodies(motion, *near))])
        size = float(np.ptp(near, axis=0).max())
        low, high = planar_scene.roomy(known, size) if planar else roomy(known)
        return cls(motion, motion.knots, planar, near, links, view, low, high)

    @property
    def _scene(self) -> Any:
        return planar_scene if self.planar else spatial_scene

    def axes(self, figure: Figure, place: Any) -> Any:
        """What stands still: obstacles and the object's way."""
        ax: Any = figure.add_subplot(place, projection=None if self.planar else "3d")
        way = np.array([knot.object.position for knot in self.knots])
        if self.planar:
            planar_scene.draw_bodies(ax, self.motion, self.low, self.high)
            ax.plot(*way.T, color=style.INK, linewidth=1.2, zorder=2.5)
            ax.plot(*way[0], color=style.INK, marker="o", markersize=5, markerfacecolor="white",
                    zorder=2.5)  # fmt: skip
            ax.set_xlim(self.low[0], self.high[0])
            ax.set_ylim(self.low[1], self.high[1])
            ax.set_aspect("equal", anchor="N")
            ax.set_xlabel("x, m")
            ax.set_ylabel("y, m")
            ax.tick_params(labelsize=9)
        else:
            ax.plot(*way.T, color=style.INK, linewidth=1.2, zorder=spatial_scene.ON_TOP)
            ax.plot(*way[:1].T, color=style.INK, marker="o", markersize=5, markerfacecolor="white",
                    zorder=spatial_scene.ON_TOP)  # fmt: skip
            frame(ax, self.low, self.high, ("x, m", "y, m", "z, m"), self.view)
            ax.patch.set_visible(False)
            self._fill(ax)
        return ax

    def _fill(self, ax: Any) -> None:
        """As large in its place as its labels leave room for."""
        figure, place = ax.get_figure(), ax.get_position(original=True)
        for _ in range(_FITS):
            figure.draw_without_rendering()
            seen = self._seen(ax).transformed(figure.transFigure.inverted())
            grow = min(place.width / seen.width, place.height / seen.height)
            now = ax.get_position()
            off = _middle(seen) - _middle(now)
            corner = _middle(place) - grow * (off + now.size / 2)
            ax.set_position([*corner, *(grow * now.size)])

    def _seen(self, ax: Any) -> Bbox:
        """The box around axes in space and their labels, in pixels."""
        corners = np.array(list(product(*zip(self.low, self.high, strict=True))))
        x, y, _ = proj_transform(*corners.T, ax.get_proj())
        flat = ax.transData.transform(np.column_stack([x, y]))
        labels = (axis.get_tightbbox() for axis in (ax.xaxis, ax.yaxis, ax.zaxis))
        return Bbox.union([Bbox([flat.min(axis=0), flat.max(axis=0)]), *labels])

    def legend(self, figure: Figure, ax: Any, left: float, top: float, columns: int) -> None:
        """Which arm is which, from a corner on."""
        handles, labels = ax.get_legend_handles_labels()
        figure.legend(handles, labels, loc="upper left", bbox_to_anchor=(left, top), ncols=columns,
                      **legends.SMALL)  # fmt: skip

    def posture(self, ax: Any, k: int) -> None:
        """Arms, object and obstacles at a knot."""
        knot = self.knots[k]
        if self.planar:
            planar_scene.draw_posture(ax, knot, self.motion)
            return
        size = float((self.high - self.low).max())
        polygons = Polygons(self.view, spatial_scene.PIECE * size)
        for body in bodies(self.motion, *self.near):
            spatial_scene.draw_body(ax, polygons, body, self.view)
        links = self.links.placed(knot)
        spatial_scene.draw_posture(ax, polygons, knot, self.motion, links, size)
        polygons.draw(ax)

    def ghosts(self, ax: Any, ks: list[int]) -> None:
        """Arms and object at some knots, light to dark."""
        for k, strength in zip(ks, np.linspace(_FAINT, _STRONG, len(ks)), strict=True):
            self._scene.draw_ghost(ax, self.knots[k], self.motion, float(strength))

    def spaced(self, count: int) -> list[int]:
        """As many knots, or fewer, between which arms and object move equally far."""
        points = np.array([self._scene.posture_points(knot, self.motion) for knot in self.knots])
        steps = np.linalg.norm(np.diff(points, axis=0), axis=2).max(axis=1)
        way = np.concatenate([[0.0], np.cumsum(steps)])
        wanted = np.linspace(0.0, way[-1], count)
        return sorted({int(np.argmin(np.abs(way - each))) for each in wanted} | {len(way) - 1})


def _middle(box: Bbox) -> Array:
    return np.asarray(box.corners().mean(axis=0))
