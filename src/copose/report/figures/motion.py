"""Pictures and films of motions: arms and object at some of their times, and charts along time."""

from __future__ import annotations

import io
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox
from mpl_toolkits.mplot3d.proj3d import proj_transform
from PIL import Image

from copose.poses import Array
from copose.problem import SPACES
from copose.report.charts.legends import legend_entries, small_grid, small_legend
from copose.report.charts.motion import draw_joints, draw_limits, draw_objective
from copose.report.geometry.camera import View, best_view, frame, roomy
from copose.report.geometry.hulls import LinkBodies
from copose.report.geometry.shapes import (
    near_obstacles,
    object_points,
    planar_points,
    spatial_points,
)
from copose.report.joint_curves import limit_shares
from copose.report.look import LOOK
from copose.report.scene import planar as planar_scene
from copose.report.scene import spatial as spatial_scene
from copose.report.scene.polygons import ON_TOP
from copose.report.words import motion_heading, three
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
            ax.set_anchor("N")
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
        bodies, links = near_obstacles(self.motion, *self.near), self.links.placed(knot)
        spatial_scene.draw_posture(ax, self.view, size, knot, self.motion, links, bodies).draw(ax)

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


@dataclass(frozen=True)
class MotionLook:
    """Sizes of the picture of a motion, inches but for the last three."""

    wide: float = 15.0  # width of the picture
    scene: float = 5.9  # height of the scene
    joints: float = 2.5  # height of a row of joints
    head: float = 0.45  # height above the scene
    foot: float = 0.5  # height below the joints
    apart: float = 1.0  # between charts of joints
    left: float = 0.035  # where the picture begins, as a share of its width
    in_row: int = 4  # charts of joints in a row
    postures: int = 6  # postures that are drawn, the last in full


def motion_figure(motion: Motion) -> Figure:
    """Postures along the path, the objective, the use of limits, and every arm's joints."""
    shares, arms = limit_shares(motion), list(motion.joint_names)
    columns = min(len(arms), MotionLook.in_row)
    rows = -(-len(arms) // columns)
    tall = MotionLook.head + MotionLook.scene + MotionLook.joints * rows + MotionLook.foot
    figure = Figure(figsize=(MotionLook.wide, tall))
    figure.suptitle(motion_heading(motion), fontweight="bold", x=MotionLook.left, y=1 - 0.15 / tall,
                    ha="left", va="top")  # fmt: skip
    edge = (MotionLook.foot + MotionLook.joints * rows) / tall
    top = 1 - MotionLook.head / tall
    scene = MotionScene.of(motion)
    right = figure.add_gridspec(1 + bool(shares), 1, left=0.541, right=0.97, hspace=0.55,
                                bottom=edge + 0.65 / tall, top=top - 0.5 / tall,
                                height_ratios=[1.5, 1.0][: 1 + bool(shares)])  # fmt: skip
    width = 0.925 * MotionLook.wide / columns - MotionLook.apart * (1 - 1 / columns)
    below = figure.add_gridspec(rows, columns, left=MotionLook.left + 0.01, right=0.97,
                                bottom=MotionLook.foot / tall, top=edge - 0.2 / tall, hspace=0.42,
                                wspace=MotionLook.apart / width)  # fmt: skip
    _draw_scene(figure, scene, edge, top, tall)
    charts = [figure.add_subplot(right[0, 0])]
    draw_objective(charts[0], motion)
    if shares:
        charts.append(figure.add_subplot(right[1, 0]))
        draw_limits(charts[-1], shares)
    for k, arm in enumerate(arms):
        charts.append(figure.add_subplot(below[divmod(k, columns)]))
        draw_joints(charts[-1], motion, arm)
    for chart in charts[bool(shares) :]:
        chart.set_xlabel("time, s", labelpad=1)
    return figure


def _draw_scene(figure: Figure, scene: MotionScene, edge: float, top: float, tall: float) -> None:
    """Postures at the left, from a lower edge to an upper one, shares of the height, light to dark,
    with their times and a legend above.
    """
    motion = scene.motion
    assert motion.time is not None
    columns, lines = small_grid(legend_entries(motion.joint_names), 0.45 * MotionLook.wide)
    highest = top - (0.42 + 0.2 * lines) / tall
    place: Any = figure.add_gridspec(1, 1, left=MotionLook.left + 0.02 * scene.planar, right=0.48,
                                     bottom=edge + 0.65 / tall, top=highest)[0, 0]  # fmt: skip
    ax = scene.axes(figure, place)
    *passed, last = scene.spaced(MotionLook.postures)
    scene.ghosts(ax, passed)
    scene.posture(ax, last)
    times = ", ".join(three(motion.time[k]) for k in (*passed, last))
    figure.text(MotionLook.left, top - 0.15 / tall, f"light to dark: at {times} s", fontsize=10,
                va="top")  # fmt: skip
    scene.legend(figure, ax, MotionLook.left, top - 0.3 / tall, columns)


@dataclass(frozen=True)
class FilmLook:
    """Size and pace of a film."""

    rate: float = 25.0  # frames a second, at most
    most: int = 100  # frames of a long motion
    least: int = 12  # frames of a short motion
    rest: float = 0.8  # time for which the end is seen, s
    width: float = 10.0  # inches
    height: float = 4.8  # inches
    dpi: int = 90  # pixels to an inch
    left: float = 0.03  # where the frame begins, as a share of its width


def motion_film(motion: Motion) -> bytes:
    """A GIF in real time, of the knots that are nearest to its instants."""
    assert motion.time is not None and motion.knots is not None
    time = np.array(motion.time)
    duration = max(float(time[-1] - time[0]), 1 / FilmLook.rate)
    count = min(len(time), max(FilmLook.least, min(FilmLook.most, round(FilmLook.rate * duration))))
    ks = np.linspace(0, len(time) - 1, count).round().astype(int)
    rate = min(FilmLook.rate, max(count - 1, 1) / duration)
    scene, figure = MotionScene.of(motion), _figure(motion)
    columns, lines = small_grid(legend_entries(motion.joint_names), 0.48 * FilmLook.width)
    left = figure.add_gridspec(1, 1, left=FilmLook.left + 0.04 * scene.planar, right=0.52,
                               bottom=0.11,
                               top=1 - (0.5 + 0.2 * lines) / FilmLook.height)  # fmt: skip
    right = figure.add_gridspec(1, 1, left=0.59, right=0.96, bottom=0.11, top=0.79)
    ax = scene.axes(figure, left[0, 0])
    chart = figure.add_subplot(right[0, 0])
    draw_objective(chart, motion)
    chart.set_xlabel("time, s", labelpad=1)
    line = chart.axvline(time[0], color=LOOK.ink, linewidth=1)
    (marker,) = chart.plot([], [], marker="o", markersize=8, color=LOOK.system,
                           markeredgecolor="white", zorder=6, clip_on=False)  # fmt: skip
    still = set(ax.get_children())
    scene.posture(ax, 0)
    scene.legend(figure, ax, FilmLook.left, 1 - 0.4 / FilmLook.height, columns)
    frames = []
    for k in ks:
        _clear(ax, still)
        scene.posture(ax, k)
        value = motion.knots[k].objective
        line.set_xdata([time[k], time[k]])
        marker.set_data([time[k]], [np.nan if value is None else value])
        frames.append(_pixels(figure))
    shown = [round(1000 / rate)] * len(frames)
    shown[-1] += round(1000 * FilmLook.rest)
    gif = io.BytesIO()
    frames[0].save(gif, "GIF", save_all=True, append_images=frames[1:], duration=shown, loop=0)
    return gif.getvalue()


def _figure(motion: Motion) -> Figure:
    """A figure with the heading alone."""
    figure = Figure(figsize=(FilmLook.width, FilmLook.height), facecolor="white")
    figure.suptitle(motion_heading(motion), fontweight="bold", fontsize=10, x=FilmLook.left,
                    y=0.975, ha="left", va="top")  # fmt: skip
    return figure


def _pixels(figure: Figure) -> Image.Image:
    size = round(FilmLook.width * FilmLook.dpi), round(FilmLook.height * FilmLook.dpi)
    pixels = io.BytesIO()
    figure.savefig(pixels, format="rgba", dpi=FilmLook.dpi)
    return Image.frombytes("RGBA", size, pixels.getvalue()).convert("RGB")


def _clear(ax: Any, still: set[Any]) -> None:
    """Axes without what moves."""
    for artist in ax.get_children():
        if artist not in still:
            artist.remove()
