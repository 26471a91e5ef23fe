"""Pictures of object and arms before anything is solved, with the frames that matter."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from copose.collision import Solid, link_solids
from copose.errors import InputError
from copose.poses import Pose
from copose.problem import Problem
from copose.report.geometry.camera import View, best_view, frame, roomy
from copose.report.geometry.hulls import LinkBodies, LinkBody
from copose.report.geometry.shapes import (
    near_obstacles,
    object_points,
    planar_points,
    spatial_points,
)
from copose.report.look import LOOK, arm_colors
from copose.report.scene import planar as planar_scene
from copose.report.scene import spatial as spatial_scene
from copose.report.scene.polygons import ON_TOP
from copose.report.text.start import start_words
from copose.report.words import short
from copose.results import (
    ArmRecord,
    EllipsoidRecord,
    Posture,
    ProblemRecord,
    link_records,
    matrix,
    place,
    vector,
)
from copose.robots import ArmStart


@dataclass(frozen=True, eq=False)
class StartScene:
    """The scene of a problem that has no result yet."""

    problem: ProblemRecord  # the problem as results record it
    posture: Posture  # the starts; without ellipsoids

    @classmethod
    def of(cls, problem: Problem, starts: Sequence[ArmStart], *, bodies: bool = True) -> StartScene:
        """The scene of arms at their starts, with bodies of their links or without."""
        planar, nothing = problem.space.planar, EllipsoidRecord.of(None)
        arms = [start.arm for start in starts]
        solids: tuple[Solid, ...] = ()
        # A robot whose shapes cannot be read is drawn by its joints alone.
        with contextlib.suppress(InputError):
            solids = link_solids(problem, arms).solids if bodies else ()
        record = ProblemRecord.of(problem, link_records(solids, arms, planar=planar))
        records = {
            start.arm.name: ArmRecord(
                skeleton=matrix(np.array([frame.position for frame in start.frames])),
                quaternions=matrix(np.array([frame.quaternion for frame in start.frames])),
                grasp=vector(start.grasp.position),
                ellipsoid=nothing,
            )
            for start in starts
        }
        posture = Posture(
            joints={start.arm.name: vector(start.joints) for start in starts},
            object=place(problem.object.pose, planar),
            closure_error={start.arm.name: max(start.gap, start.turn) for start in starts},
            ellipsoid=nothing,
            log_volumes={},
            arms=records,
        )
        return cls(record, posture)


@dataclass(frozen=True, eq=False)
class _NamedFrame:
    """A frame of the picture, and its name."""

    name: str
    pose: Pose  # the frame in the world
    color: str  # colour of the name
    dashed: bool = False  # whether it is a frame that something should have
    # Side of the frame's origin on which the name stands.
    side: Literal["left", "center", "right"] = "center"

    @property
    def width(self) -> float:
        """Width of its lines, points."""
        return 1.4 if self.dashed else 2.4

    @property
    def line(self) -> Any:
        """Style of its lines."""
        return LOOK.dashes if self.dashed else "-"

    @property
    def above(self) -> bool:
        """True where the name stands above the origin."""
        return self.side != "center" and not self.dashed

    @property
    def words(self) -> dict[str, Any]:
        """Keywords of Matplotlib that set the name away from the object."""
        away = {"left": "right", "right": "left", "center": "center"}[self.side]
        return {
            "fontsize": 9, "ha": away, "va": "bottom" if self.above else "top", "color": self.color,
            "path_effects": [withStroke(linewidth=2.5, foreground="white")],
        }  # fmt: skip


def start_figure(problem: Problem, starts: Sequence[ArmStart], *, bodies: bool = True) -> Figure:
    """Arms at their starts, as bodies or as sticks between joints, the object, obstacles, and the
    frames of object, tips and grasps.
    """
    scene, planar = StartScene.of(problem, starts, bodies=bodies), problem.space.planar
    colors = arm_colors(scene.posture)
    named = [_NamedFrame("object", problem.object.pose, LOOK.ink)]
    links, view = [], View()
    if not planar:
        links = LinkBodies.of(scene.problem).placed(scene.posture)
        view = best_view([(links, object_points(scene.posture, scene))])
    right = np.array([1.0, 0.0, 0.0]) if planar else view.axes[0]
    for start in starts:
        name, color = short(start.arm.name), colors[start.arm.name]
        places = [("tip", start.tip, False)]
        places += [] if start.closed else [("grasp", start.grasp, True)]
        for what, pose, dashed in places:
            away = float(right @ (pose.position - problem.object.pose.position))
            side: Literal["left", "right"] = "left" if away < 0 else "right"
            named.append(_NamedFrame(f"{name} {what}", pose, color, dashed, side))
    given = all(start.given for start in starts)
    where = "at the start" if given else "without a start, at a random posture"
    figure = Figure(figsize=(9.0, 8.0))
    if planar:
        _draw_planar(figure, scene, named)
    else:
        _draw_spatial(figure, scene, named, links, view)
    figure.suptitle(f"{short(problem.name, 60)}: {where}", fontweight="bold", x=0.02,
                    y=0.985, ha="left")  # fmt: skip
    words = "\n".join(start_words(start) for start in starts)
    figure.text(0.02, 0.945, words, fontsize=9.5, va="top")
    figure.text(0.92, 0.985, "frames:", fontsize=9.5, va="top", ha="right")
    for k, (axis, color) in enumerate(zip("xy" if planar else "xyz", LOOK.axes, strict=False)):
        figure.text(0.94 + 0.02 * k, 0.985, axis, fontsize=9.5, va="top", ha="center", color=color,
                    fontweight="bold")  # fmt: skip
    return figure


def _draw_spatial(
    figure: Figure, scene: StartScene, named: Sequence[_NamedFrame], links: Sequence[LinkBody],
    view: View, share: float = 0.09,
) -> None:  # fmt: skip
    """A scene in space; axes of frames are a share of it long."""
    ax: Any = figure.add_axes((0.0, 0.02, 1.0, 0.88), projection="3d")
    known = spatial_points(scene.posture, scene)
    known = np.vstack([known, *(link.points for link in links)])
    around = near_obstacles(scene, known.min(axis=0), known.max(axis=0))
    low, high = roomy(np.vstack([known, *(body.points for body in around)]))
    size = float((high - low).max())
    frame(ax, low, high, ("x, m", "y, m", "z, m"), view, whole=True)
    spatial_scene.draw_posture(ax, view, size, scene.posture, scene, links, around).draw(ax)
    length = share * size
    for mark in named:
        for axis, color in zip(mark.pose.rotation.T, LOOK.axes, strict=True):
            ends = np.array([mark.pose.position, mark.pose.position + length * axis])
            ax.plot(*ends.T, color=color, linewidth=mark.width, linestyle=mark.line,
                    zorder=ON_TOP)  # fmt: skip
        offset = view.axes[1] * (0.3 if mark.above else -0.3) * length
        ax.text(*(mark.pose.position + offset), mark.name, zorder=ON_TOP + 1,
                **mark.words)  # fmt: skip
    ax.legend(loc="lower left", frameon=False, fontsize=9)


def _draw_planar(
    figure: Figure, scene: StartScene, named: Sequence[_NamedFrame], share: float = 0.09
) -> None:
    """A scene in the plane; axes of frames are a share of it long."""
    ax = figure.add_axes((0.08, 0.07, 0.89, 0.8))
    known = planar_points(scene.posture, scene)
    size = float(np.ptp(known, axis=0).max())
    around = near_obstacles(scene, known.min(axis=0), known.max(axis=0))
    low, high = planar_scene.roomy(np.vstack([known, *(body.points for body in around)]), size)
    planar_scene.draw_bodies(ax, scene, low, high)
    planar_scene.draw_posture(ax, scene.posture, scene)
    ax.set_xlabel("x, m")
    ax.set_ylabel("y, m")
    length = share * size
    for mark in named:
        origin = mark.pose.position[:2]
        for axis, color in zip(mark.pose.rotation[:2, :2].T, LOOK.axes, strict=False):
            ends = np.array([origin, origin + length * axis])
            ax.plot(*ends.T, color=color, linewidth=mark.width, linestyle=mark.line, zorder=8)
        ax.annotate(mark.name, tuple(origin), xytext=(0, 8 if mark.above else -8),
                    textcoords="offset points", zorder=9, **mark.words)  # fmt: skip
    ax.legend(loc="lower left", frameon=False, fontsize=9)
