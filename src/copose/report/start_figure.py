"""A picture of object and arms before anything is solved, with the frames that matter."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from copose.errors import InputError
from copose.poses import Array, Pose
from copose.problem import Problem
from copose.report import planar_scene, spatial_scene, style
from copose.report.frames import frame, roomy, view_axes
from copose.report.starts import StartScene, start_words
from copose.report.surroundings import bodies, silhouette
from copose.robots import ArmStart

# Colours of the axes x, y, z.
_AXES = ("#D55E00", "#009E73", "#0072B2")
# Length of a frame's axes, as a share of the scene.
_LENGTH = 0.09
# Points on the rim of a round shape.
_RIM = 24


@dataclass(frozen=True, eq=False)
class _Named:
    """A frame of the picture, and what it is called.

    Attributes:
        name: what it is called.
        pose: in the world.
        color: of the name.
        dashed: whether it is where something should be.
        side: of the frame's origin on which the name stands.
    """

    name: str
    pose: Pose
    color: str
    dashed: bool = False
    side: Literal["left", "center", "right"] = "center"

    @property
    def width(self) -> float:
        """Of the lines, points."""
        return 1.4 if self.dashed else 2.4

    @property
    def line(self) -> Any:
        """The kind of the lines."""
        return style.DASHES if self.dashed else "-"

    @property
    def above(self) -> bool:
        """Whether the name stands above the origin."""
        return self.side != "center" and not self.dashed

    @property
    def words(self) -> dict[str, Any]:
        """How the name is set: away from the object."""
        away = {"left": "right", "right": "left", "center": "center"}[self.side]
        return {
            "fontsize": 9, "ha": away, "va": "bottom" if self.above else "top", "color": self.color,
            "path_effects": [withStroke(linewidth=2.5, foreground="white")],
        }  # fmt: skip


def start_figure(problem: Problem, starts: Sequence[ArmStart]) -> Figure:
    """Arms at their starts, the object, obstacles, and the frames of object, tips and grasps."""
    scene, planar = StartScene.of(problem, starts), problem.space.planar
    colors = style.arm_colors(scene.posture)
    named = [_Named("object", problem.object.pose, style.INK)]
    right = np.array([1.0, 0.0, 0.0]) if planar else view_axes()[0]
    for start in starts:
        name, color = style.short(start.arm.name), colors[start.arm.name]
        places = [("tip", start.tip, False)]
        places += [] if start.closed else [("grasp", start.grasp, True)]
        for what, pose, dashed in places:
            away = float(right @ (pose.position - problem.object.pose.position))
            side: Literal["left", "right"] = "left" if away < 0 else "right"
            named.append(_Named(f"{name} {what}", pose, color, dashed, side))
    figure = Figure(figsize=(9.0, 8.0))
    (_draw_planar if planar else _draw_spatial)(figure, problem, starts, scene, named)
    figure.suptitle(f"{style.short(problem.name, 60)}: at the start", fontweight="bold", x=0.02,
                    y=0.985, ha="left")  # fmt: skip
    words = "\n".join(start_words(start) for start in starts)
    figure.text(0.02, 0.945, words, fontsize=9.5, va="top")
    figure.text(0.92, 0.985, "frames:", fontsize=9.5, va="top", ha="right")
    for k, (axis, color) in enumerate(zip("xy" if planar else "xyz", _AXES, strict=False)):
        figure.text(0.94 + 0.02 * k, 0.985, axis, fontsize=9.5, va="top", ha="center", color=color,
                    fontweight="bold")  # fmt: skip
    return figure


def _draw_spatial(
    figure: Figure, problem: Problem, starts: Sequence[ArmStart], scene: StartScene,
    named: Sequence[_Named],
) -> None:  # fmt: skip
    ax: Any = figure.add_axes((0.0, 0.02, 1.0, 0.88), projection="3d")
    colors = style.arm_colors(scene.posture)
    outlines = list(_links(problem, starts, colors))
    known = spatial_scene.posture_points(scene.posture, scene)
    known = np.vstack([known, *(rim for _, rim in outlines)])
    around = bodies(scene, known.min(axis=0), known.max(axis=0))
    low, high = roomy(np.vstack([known, *(body.points for body in around)]))
    for body in around:
        spatial_scene.draw_body(ax, body)
    for color, rim in outlines:
        link = Poly3DCollection([rim], facecolor=color, edgecolor=color, alpha=0.13, linewidth=0.4)
        ax.add_collection3d(link)
    spatial_scene.draw_posture(ax, scene.posture, scene)
    frame(ax, low, high, ("x, m", "y, m", "z, m"), whole=True)
    length = _LENGTH * float((high - low).max())
    for each in named:
        for axis, color in zip(each.pose.rotation.T, _AXES, strict=True):
            ends = np.array([each.pose.position, each.pose.position + length * axis])
            ax.plot(*ends.T, color=color, linewidth=each.width, linestyle=each.line,
                    zorder=spatial_scene.ON_TOP)  # fmt: skip
        offset = view_axes()[1] * (0.3 if each.above else -0.3) * length
        ax.text(*(each.pose.position + offset), each.name, zorder=spatial_scene.ON_TOP + 1,
                **each.words)  # fmt: skip
    ax.legend(loc="lower left", frameon=False, fontsize=9)


def _draw_planar(
    figure: Figure, problem: Problem, starts: Sequence[ArmStart], scene: StartScene,
    named: Sequence[_Named],
) -> None:  # fmt: skip
    ax = figure.add_axes((0.08, 0.07, 0.89, 0.8))
    known = planar_scene.posture_points(scene.posture, scene)
    size = float(np.ptp(known, axis=0).max())
    around = bodies(scene, known.min(axis=0), known.max(axis=0))
    low, high = planar_scene.roomy(np.vstack([known, *(body.points for body in around)]), size)
    planar_scene.draw_bodies(ax, scene, low, high)
    planar_scene.draw_posture(ax, scene.posture, scene)
    ax.set_xlim(low[0], high[0])
    ax.set_ylim(low[1], high[1])
    ax.set_aspect("equal")
    ax.set_xlabel("x, m")
    ax.set_ylabel("y, m")
    length = _LENGTH * size
    for each in named:
        origin = each.pose.position[:2]
        for axis, color in zip(each.pose.rotation[:2, :2].T, _AXES, strict=False):
            ends = np.array([origin, origin + length * axis])
            ax.plot(*ends.T, color=color, linewidth=each.width, linestyle=each.line, zorder=8)
        ax.annotate(each.name, tuple(origin), xytext=(0, 8 if each.above else -8),
                    textcoords="offset points", zorder=9, **each.words)  # fmt: skip
    ax.legend(loc="lower left", frameon=False, fontsize=9)


def _links(
    problem: Problem, starts: Sequence[ArmStart], colors: Mapping[str, str]
) -> Iterator[tuple[str, Array]]:
    """What is seen of the hulls of the robots' links, corners (k, 3) each, and their colours.

    A robot whose shapes cannot be read is drawn by its joints alone.
    """
    from copose.collision.robot_solids import robot_solids

    solids = []
    with contextlib.suppress(InputError):
        solids = list(robot_solids(problem, [start.arm for start in starts]).solids)
    view = view_axes()
    angles = np.arange(_RIM) * 2 * np.pi / _RIM
    rim = np.cos(angles)[:, None] * view[0] + np.sin(angles)[:, None] * view[1]
    for solid in solids:
        start = starts[solid.carrier.arm]
        color = style.BEFORE if solid.carrier.static else colors[start.arm.name]
        carried = start.frames[solid.carrier.joint + 1] @ solid.placement
        for part in solid.parts:
            pose = carried @ part.placement
            points, radius = part.shape.hull
            points = points @ pose.rotation.T + pose.position
            if radius:
                points = (points[:, None] + radius * rim).reshape(-1, 3)
            edge = silhouette(points, points @ view[:2].T)
            if len(edge):
                yield color, edge
