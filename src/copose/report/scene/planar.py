"""Scenes in the plane: object, arms, ellipses, obstacles; and, in space too, ranges and forces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, PathPatch, Polygon
from matplotlib.path import Path
from matplotlib.patheffects import withStroke

from copose.poses import Array
from copose.problem import PlanarObstacle
from copose.report.charts.legends import Entry
from copose.report.geometry.hulls import flat_links
from copose.report.geometry.shapes import (
    cut,
    near_obstacles,
    object_outline,
    outline,
    planar_points,
    ranges,
)
from copose.report.geometry.slices import Slice, all_coordinates, linear_slice
from copose.report.look import LOOK, arm_colors
from copose.report.panels import Drawn, Panel, holds, shared_scales
from copose.report.words import short, three
from copose.results import Posture


def holding_arrows(
    posture: Posture, size: float, *, longest: float = 0.16
) -> tuple[list[tuple[Array, Array]], str]:
    """Contact forces that hold the object: arrows from tail to head at the grasp, and in words;
    none where they are not known. The longest is a share of the scene's size, m.
    """
    wrenches = (posture.wrenches or {}).get("hold", {})
    d = len(posture.object.position)
    forces = {arm: np.array(record.wrench[:d]) for arm, record in wrenches.items()}
    largest = max((float(np.linalg.norm(force)) for force in forces.values()), default=0.0)
    if not largest:
        return [], ""
    arrows = []
    for arm, force in forces.items():
        head = np.array(posture.arms[arm].grasp[:d])
        arrows.append((head - force * (longest * size / largest), head))
    return arrows, f"contact forces holding it, up to {three(largest)} N"


def draw_arrows(ax: Any, arrows: list[tuple[Array, Array]], words: str) -> None:
    """Arrows from tail to head, in axes in the plane or in space, with an entry of the legend."""
    for tail, head in arrows:
        if ax.name == "3d":
            ax.quiver(*tail, *(head - tail), color=LOOK.ink, linewidth=1.8, arrow_length_ratio=0.3)
        else:
            ax.annotate("", tuple(head), tuple(tail), zorder=7,
                        arrowprops={"arrowstyle": "-|>", "color": LOOK.ink, "linewidth": 1.8,
                                    "shrinkA": 0, "shrinkB": 0, "mutation_scale": 14})  # fmt: skip
    if arrows:
        ax.plot([], [], color=LOOK.ink, linewidth=1.8, label=words)


Placed: TypeAlias = tuple[Array, Slice, str | None]
"""Centre, slice and arm of an ellipse; the system's has no arm."""


@dataclass(frozen=True, eq=False)
class PlanarStage:
    """Axes that all scenes of a picture share."""

    placed: list[list[Placed]]  # ellipses, by panel
    # Metres drawn per unit of acceleration, by panel; None where nothing is drawn.
    scales: list[float] | None
    size: float  # size of arms and objects, m
    low: Array  # least x and y of all that is drawn, (2,)
    high: Array  # largest x and y

    @classmethod
    def of(cls, panels: list[Panel]) -> PlanarStage:
        """Axes in which all panels have room; the longest semi-axis is 0.3 of arms and objects."""
        points = [np.vstack([planar_points(panel.posture, panel.solution) for panel in panels])]
        size = float((points[0].max(axis=0) - points[0].min(axis=0)).max())
        placed = [_placed(panel) for panel in panels]
        longest = [
            max((float(p.ellipsoid.radii[0]) for _, p, _ in ps), default=0.0) for ps in placed
        ]
        scales = shared_scales(panels, longest, 0.3 * size)
        for scale, parts in zip(scales or [], placed, strict=scales is not None):
            points += [center + scale * part.surface[..., :2] for center, part, _ in parts]
        for panel in panels:
            points += [box.edges.reshape(-1, 2) for box in ranges(panel)]
            outlines = flat_links(panel.solution.problem, panel.posture)
            points += [rim for rims in outlines.values() for rim in rims]
        known = np.vstack(points)
        return cls(placed, scales, size, known.min(axis=0), known.max(axis=0))

    def frame(self, panels: list[Panel], further: Sequence[Array]) -> tuple[Array, Array]:
        """Limits with obstacles, further points, (2,) each, and a margin."""
        low, high = self.low, self.high
        points = [body.points for p in panels for body in near_obstacles(p.solution, low, high)]
        known = np.vstack([low, high, *further, *points])
        return roomy(known, self.size)

    def draw(self, ax: Axes, panels: list[Panel], k: int, low: Array, high: Array) -> None:
        """The scene of one of the panels."""
        panel = panels[k]
        draw_bodies(ax, panel.solution, low, high)
        draw_posture(ax, panel.posture, panel.solution)
        _ellipses(ax, panel, self.placed[k], self.scales[k] if self.scales else 1.0)
        draw_ranges(ax, panel, 1.4, 7)


def roomy(points: Array, size: float) -> tuple[Array, Array]:
    """The box around points, (k, 2), with a margin for a scene of a size, m."""
    low, high = points.min(axis=0), points.max(axis=0)
    # A flat scene still needs a frame to be read in.
    least = 0.4 * float((high - low).max())
    margin = 0.04 * size + np.maximum(least - (high - low), 0.0) / 2
    return low - margin, high + margin


def _placed(panel: Panel) -> list[Placed]:
    """The ellipses of a posture."""
    posture, solution = panel.posture, panel.solution
    placed: list[Placed] = []
    for name, arm in posture.arms.items():
        own = linear_slice(arm.ellipsoid, all_coordinates(solution))
        if own is not None and holds(posture, name):
            placed.append((np.array(arm.skeleton[-1][:2]), own, name))
    whole = linear_slice(posture.ellipsoid, solution.problem.axes)
    if whole is not None:
        placed.append((np.array(posture.object.position), whole, None))
    return placed


def draw_bodies(
    ax: Axes, solution: Drawn, low: Array, high: Array, *, letter: float = 0.016
) -> None:
    """Set the limits of axes at one scale, and draw obstacles within them, each with its name in
    the middle of its visible part, or below; a letter is such a share of the axes wide.
    """
    ax.set_xlim(low[0], high[0])
    ax.set_ylim(low[1], high[1])
    ax.set_aspect("equal")
    for obstacle in solution.problem.obstacles:
        if not isinstance(obstacle, PlanarObstacle):
            continue
        corners = outline(obstacle.shape, obstacle.position, obstacle.angle)
        seen = cut(corners, low, high)
        if not len(seen):
            continue
        body = Polygon(corners, facecolor="#EFEFEF", edgecolor=LOOK.obstacle, linewidth=1,
                       hatch="////", zorder=1)  # fmt: skip
        ax.add_patch(body)
        words = short(obstacle.name)
        first, last = seen.min(axis=0), seen.max(axis=0)
        width = letter * len(words) * (high - low)[0]
        small = (last - first)[0] < width and (last - first)[1] < 0.15 * (high - low)[1]
        x, y = (first + last) / 2
        x = np.clip(x, low[0] + width / 2, high[0] - width / 2)
        name = ax.text(x, first[1] if small else y, words, fontsize=8, color=LOOK.ink,
                       ha="center", va="top" if small else "center", zorder=8)  # fmt: skip
        name.set_path_effects([withStroke(linewidth=2.5, foreground="white")])


def draw_ghost(ax: Axes, posture: Posture, solution: Drawn, strength: float) -> None:
    """Arms and object as they pass by."""
    rim = object_outline(posture, solution)
    if rim is not None:
        ax.add_patch(Polygon(rim, fill=False, edgecolor=LOOK.ink, linewidth=0.8, zorder=1.8,
                             alpha=0.7 * strength))  # fmt: skip
    for name, color in arm_colors(posture).items():
        points = np.array(posture.arms[name].skeleton)[:, :2]
        ax.plot(*points.T, color=color, linewidth=3, alpha=strength, zorder=1.9,
                solid_capstyle="round", solid_joinstyle="round")  # fmt: skip


def draw_posture(ax: Axes, posture: Posture, solution: Drawn) -> None:
    """Arms and object; bodies of links where these keep clear."""
    ax.grid(True, color=LOOK.grid, linewidth=0.8)
    ax.set_axisbelow(True)
    center = np.array(posture.object.position)
    colors = arm_colors(posture)
    for name, corners in flat_links(solution.problem, posture).items():
        # In one piece, so that overlaps are no darker.
        rims = [Path(np.vstack([rim, rim[:1]]), closed=True) for rim in corners]
        ax.add_patch(PathPatch(Path.make_compound_path(*rims), facecolor=colors[name], alpha=0.15,
                               linewidth=0, zorder=1.5))  # fmt: skip
    rim = object_outline(posture, solution)
    if rim is not None:
        ax.add_patch(
            Polygon(rim, facecolor=LOOK.held_object, edgecolor=LOOK.ink, linewidth=1, zorder=2)
        )
    for name, color in colors.items():
        arm = posture.arms[name]
        points = np.array(arm.skeleton)[:, :2]
        ax.plot(*points.T, color=color, linewidth=5, solid_capstyle="round",
                solid_joinstyle="round", alpha=0.85, zorder=3,
                label=f"arm {short(name)}")  # fmt: skip
        ax.plot(*points[1:-1].T, linestyle="", marker="o", markersize=7, markerfacecolor="white",
                markeredgecolor=LOOK.ink, markeredgewidth=1.2, zorder=5)  # fmt: skip
        ax.plot(*points[-1], marker="o", markersize=4, color=LOOK.ink, zorder=5)
        ax.plot(*points[0], marker="s", markersize=12, color=color, alpha=0.5, zorder=2)
        if not holds(posture, name):
            gap = np.array([points[-1], arm.grasp[:2]])
            ax.plot(*gap.T, color=LOOK.ink, linewidth=1.2, linestyle=":", zorder=5)
            ax.plot(*gap[1], marker="x", markersize=8, color=LOOK.ink, zorder=6)
    ax.add_patch(Circle(tuple(center), 0.008, color=LOOK.ink, zorder=6))


def _ellipses(ax: Axes, panel: Panel, parts: list[Placed], scale: float) -> None:
    """Ellipses of the arms and of the system, and the other panel's as an outline."""
    colors = arm_colors(panel.posture)
    if panel.other is not None:
        axes = panel.other.solution.problem.axes
        other = linear_slice(panel.other.posture.ellipsoid, axes)
        if other is not None:
            curve = np.array(panel.posture.object.position) + scale * other.surface[..., :2]
            ax.plot(*curve.T, color=LOOK.ink, linewidth=1.4, linestyle=":", zorder=6)
    for center, part, name in parts:
        curve = center + scale * part.surface[..., :2]
        if name is not None:
            ax.plot(*curve.T, color=colors[name], linewidth=1.4, linestyle="--", zorder=4)
            continue
        ax.fill(*curve.T, color=LOOK.system, alpha=0.25, zorder=4)
        ax.plot(*curve.T, color=LOOK.system, linewidth=2.2, zorder=6, label=Entry.TOGETHER)


def draw_ranges(ax: Any, panel: Panel, width: float, zorder: float) -> None:
    """Dashed boxes of free positions, in lines of a width, points."""
    colors, boxes = arm_colors(panel.posture), ranges(panel)
    for box in boxes:
        color = LOOK.ink if box.arm is None else colors[box.arm]
        for edge in box.edges:
            ax.plot(*edge.T, color=color, linewidth=width, linestyle=LOOK.dashes, zorder=zorder,
                    marker="." if len(box.edges) == 1 else "")  # fmt: skip
    if boxes:
        ax.plot([], [], color=LOOK.ink, linewidth=width, linestyle=LOOK.dashes,
                label=Entry.RANGES)  # fmt: skip
