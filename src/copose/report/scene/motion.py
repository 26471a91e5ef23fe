"""Scenes of motions: arms and object at some of their times, and the path of the object."""

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
from copose.report.charts.legends import small_legend
from copose.report.geometry.camera import View, best_view, frame, roomy
from copose.report.geometry.link_bodies import LinkBodies
from copose.report.geometry.shapes import (
    near_obstacles,
    object_points,
    planar_points,
    spatial_points,
)
from copose.report.look import LOOK
from copose.report.scene import planar as planar_scene
from copose.report.scene import spatial as spatial_scene
from copose.report.scene.polygons import ON_TOP, Polygons
from copose.results import Knot, Motion


@dataclass(frozen=True, eq=False)
class MotionScene:
    """Axes in which all postures of a motion have room."""

    motion: Motion
    knots: tuple[Knot, ...]  # its postures
    planar: bool  # whether it moves in the plane
    near: Array  # the box around arms and objects, (2, d)
    links: LinkBodies  # bodies of the arms
    view: View  # the direction that it is seen from
    low: Array  # least coordinates of the axes
    high: Array  # largest coordinates of the axes

    @classmethod
    def of(cls, motion: Motion) -> MotionScene:
        """The scene of a motion that has knots."""
        assert motion.knots is not None
        planar = SPACES[motion.problem.space].planar
        posture_points = planar_points if planar else spatial_points
        points = np.vstack([posture_points(knot, motion) for knot in motion.knots])
        links, view = LinkBodies((), frozenset()), View()
        if not planar:
            links, ends = LinkBodies.of(motion.problem), (motion.knots[0], motion.knots[-1])
            around = [links.placed(knot) for knot in ends]
            points = np.vstack([points, *(body.points for placed in around for body in placed)])
            things = [object_points(knot, motion) for knot in ends]
            view = best_view(list(zip(around, things, strict=True)))
        near = np.array([points.min(axis=0), points.max(axis=0)])
        known = np.vstack([near, *(body.points for body in near_obstacles(motion, *near))])
        size = float(np.ptp(near, axis=0).max())
        low, high = planar_scene.roomy(known, size) if planar else roomy(known)
        return cls(motion, motion.knots, planar, near, links, view, low, high)

    def axes(self, figure: Figure, place: Any) -> Any:
        """Axes with all that stands still: obstacles and the object's path."""
        ax: Any = figure.add_subplot(place, projection=None if self.planar else "3d")
        way = np.array([knot.object.position for knot in self.knots])
        if self.planar:
            planar_scene.draw_bodies(ax, self.motion, self.low, self.high)
            ax.plot(*way.T, color=LOOK.ink, linewidth=1.2, zorder=2.5)
            ax.plot(*way[0], color=LOOK.ink, marker="o", markersize=5, markerfacecolor="white",
                    zorder=2.5)  # fmt: skip
            ax.set_xlim(self.low[0], self.high[0])
            ax.set_ylim(self.low[1], self.high[1])
            ax.set_aspect("equal", anchor="N")
            ax.set_xlabel("x, m")
            ax.set_ylabel("y, m")
            ax.tick_params(labelsize=9)
        else:
            ax.plot(*way.T, color=LOOK.ink, linewidth=1.2, zorder=ON_TOP)
            ax.plot(*way[:1].T, color=LOOK.ink, marker="o", markersize=5, markerfacecolor="white",
                    zorder=ON_TOP)  # fmt: skip
            frame(ax, self.low, self.high, ("x, m", "y, m", "z, m"), self.view)
            ax.patch.set_visible(False)
            self._fill(ax)
        return ax

    def _fill(self, ax: Any) -> None:
        """Make axes as large in their place as their labels leave room for."""
        figure, place = ax.get_figure(), ax.get_position(original=True)
        # Labels do not grow with axes: three rounds settle.
        for _ in range(3):
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
        """A legend of the arms, with its upper left corner at a place."""
        handles, labels = ax.get_legend_handles_labels()
        small_legend(figure, handles, labels, loc="upper left", bbox_to_anchor=(left, top),
                     ncols=columns)  # fmt: skip

    def posture(self, ax: Any, k: int) -> None:
        """Arms, object and obstacles at a knot."""
        knot = self.knots[k]
        if self.planar:
            planar_scene.draw_posture(ax, knot, self.motion)
            return
        size = float((self.high - self.low).max())
        polygons = Polygons(self.view, size)
        for body in near_obstacles(self.motion, *self.near):
            spatial_scene.draw_body(ax, polygons, body, self.view)
        links = self.links.placed(knot)
        spatial_scene.draw_posture(ax, polygons, knot, self.motion, links, size)
        polygons.draw(ax)

    def ghosts(self, ax: Any, ks: list[int]) -> None:
        """Arms and object at some knots, light to dark."""
        scene: Any = planar_scene if self.planar else spatial_scene
        for k, strength in zip(ks, np.linspace(0.18, 0.55, len(ks)), strict=True):
            scene.draw_ghost(ax, self.knots[k], self.motion, float(strength))

    def spaced(self, count: int) -> list[int]:
        """At most so many knots, between which arms and object move equally far."""
        posture_points = planar_points if self.planar else spatial_points
        points = np.array([posture_points(knot, self.motion) for knot in self.knots])
        steps = np.linalg.norm(np.diff(points, axis=0), axis=2).max(axis=1)
        way = np.concatenate([[0.0], np.cumsum(steps)])
        marks = np.linspace(0.0, way[-1], count)
        return sorted({int(np.argmin(np.abs(way - mark))) for mark in marks} | {len(way) - 1})


def _middle(box: Bbox) -> Array:
    return np.asarray(box.corners().mean(axis=0))
