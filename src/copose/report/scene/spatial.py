"""Scenes in space: object, arms, slices of ellipsoids, obstacles, and free ranges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.patheffects import withStroke

from copose.poses import Array, rotation_rows
from copose.report.charts.legends import Entry
from copose.report.geometry.camera import View, best_view, frame, roomy
from copose.report.geometry.free_ranges import ranges
from copose.report.geometry.link_bodies import LinkBodies, LinkBody
from copose.report.geometry.shapes import DrawnObstacle, near_obstacles, object_faces, object_points
from copose.report.look import LOOK, arm_colors
from copose.report.panels import Drawn, Panel, holds
from copose.report.scene.planar import draw_ranges
from copose.report.scene.polygons import ON_TOP, Polygons
from copose.report.scene.spatial_slices import (
    SliceKind,
    draw_slice,
    drawn_points,
    outline_slice,
    slice_kinds,
)
from copose.report.words import short
from copose.results import Posture


@dataclass(frozen=True, eq=False)
class SpatialStage:
    """Axes that all scenes of a picture share."""

    kinds: list[SliceKind]
    low: Array  # least x, y, z of the axes
    high: Array  # largest x, y, z of the axes
    bodies: list[list[DrawnObstacle]]  # obstacles, by panel
    links: list[list[LinkBody]]  # bodies of the arms' links, alike; none where sticks are drawn
    view: View  # the direction that all of them are seen from

    @classmethod
    def of(cls, panels: list[Panel]) -> SpatialStage:
        """Axes in which all panels have room."""
        robots = {id(p.solution): LinkBodies.of(p.solution.problem) for p in panels}
        links = [robots[id(panel.solution)].placed(panel.posture) for panel in panels]
        kinds = slice_kinds(panels, links)
        points = [drawn_points(panels, kinds)]
        points += [link.points for placed in links for link in placed]
        for panel in panels:
            points += [box.edges.reshape(-1, 3) for box in ranges(panel)]
        known = np.vstack(points)
        low, high = known.min(axis=0), known.max(axis=0)
        around = [near_obstacles(panel.solution, low, high) for panel in panels]
        obstacles = [body.points for near in around for body in near]
        scenes = [
            (placed, object_points(panel.posture, panel.solution))
            for panel, placed in zip(panels, links, strict=True)
        ]
        return cls(kinds, *roomy(np.vstack([known, *obstacles])), around, links, best_view(scenes))

    def draw(self, ax: Any, panels: list[Panel], k: int, *, whole: bool = False) -> None:
        """The scene of one of the panels; ``whole`` as `frame` has it."""
        panel, size = panels[k], float((self.high - self.low).max())
        frame(ax, self.low, self.high, ("x, m", "y, m", "z, m"), self.view, whole=whole)
        polygons = Polygons(self.view, size)
        for body in self.bodies[k]:
            draw_body(ax, polygons, body, self.view)
        draw_posture(ax, polygons, panel.posture, panel.solution, self.links[k], size)
        for kind in self.kinds:
            draw_slice(ax, polygons, panel, kind, kind.scales[k])
            if panel.other is not None:
                outline_slice(ax, panel.other, kind, kind.scales[k])
        polygons.draw(ax)
        if ranges(panel):
            # Over all else: the object hides its own.
            draw_ranges(ax, panel, 1.2, ON_TOP)
            ax.plot(*np.array(panel.posture.object.position)[:, None], marker="o", markersize=4,
                    color=LOOK.ink, zorder=ON_TOP)  # fmt: skip
        if panel.other is not None:
            ax.plot([], [], color=LOOK.ink, linewidth=1, label=Entry.OTHER)


def draw_body(ax: Any, polygons: Polygons, body: DrawnObstacle, view: View) -> None:
    """An obstacle and its name, below it."""
    polygons.clear(body.faces, LOOK.obstacle, 0.4)
    if not body.round:
        polygons.edges(body.faces, LOOK.obstacle)
    lowest = body.points[np.argmin(body.points @ view.axes[1])]
    name = ax.text(*lowest, short(body.name), fontsize=8, color=LOOK.ink, ha="center",
                   va="top", zorder=ON_TOP)  # fmt: skip
    name.set_path_effects([withStroke(linewidth=2, foreground="white")])


def draw_ghost(ax: Any, posture: Posture, solution: Drawn, strength: float) -> None:
    """Arms and object as they pass by."""
    for corners in object_faces(posture, solution):
        rim = np.vstack([corners, corners[:1]])
        ax.plot(*rim.T, color=LOOK.ink, linewidth=0.6, alpha=0.6 * strength)
    for name, color in arm_colors(posture).items():
        points = np.array(posture.arms[name].skeleton)
        ax.plot(*points.T, color=color, linewidth=2.5, alpha=strength, solid_capstyle="round",
                solid_joinstyle="round")  # fmt: skip


def draw_posture(
    ax: Any, polygons: Polygons, posture: Posture, solution: Drawn, links: Sequence[LinkBody],
    size: float,
) -> None:  # fmt: skip
    """Arms, as sticks where no bodies of their links are given, and the object."""
    colors, thing = arm_colors(posture), object_faces(posture, solution)
    for link in links:
        polygons.solid(link.faces, link.normals, LOOK.before if link.arm is None
                       else colors[link.arm])  # fmt: skip
    polygons.clear(thing, LOOK.held_object, 0.3)
    if solution.problem.shape is not None and solution.problem.shape.kind == "box":
        polygons.edges(thing)
    center = np.array(posture.object.position)
    ax.plot(*center[:, None], marker="o", markersize=4, color=LOOK.ink)
    for name, color in colors.items():
        arm = posture.arms[name]
        points, grasp = np.array(arm.skeleton), np.array(arm.grasp)
        label = f"arm {short(name)}"
        if any(link.arm == name for link in links):
            ax.plot([], [], color=color, linewidth=4, label=label)
            _draw_axes(ax, points[-1], np.array(rotation_rows(arm.quaternions[-1])), 0.05 * size)
        else:
            _draw_stick(ax, points, color, label)
        if not holds(posture, name):
            ax.plot(*np.array([points[-1], grasp]).T, color=LOOK.ink, linestyle=":", linewidth=1.2,
                    zorder=ON_TOP)  # fmt: skip
            ax.plot(*grasp[:, None], marker="x", markersize=8, color=LOOK.ink, zorder=ON_TOP)
        elif solution.problem.shape is None:
            ax.plot(*np.array([grasp, center]).T, color=LOOK.held_object, linewidth=1.5)


def _draw_stick(ax: Any, points: Array, color: str, label: str) -> None:
    """An arm as lines between its joints."""
    ax.plot(*points.T, color=color, linewidth=4, solid_capstyle="round", solid_joinstyle="round",
            label=label)  # fmt: skip
    ax.plot(*points[1:-1].T, linestyle="", marker="o", markersize=5, markerfacecolor="white",
            markeredgecolor=LOOK.ink)  # fmt: skip
    ax.plot(*points[:1].T, marker="s", markersize=8, color=color)
    ax.plot(*points[-1:].T, marker="o", markersize=4, color=LOOK.ink)


def _draw_axes(ax: Any, origin: Array, rotation: Array, length: float) -> None:
    """The axes x, y, z of a frame."""
    for axis, color in zip(rotation.T, LOOK.axes, strict=True):
        ends = np.array([origin, origin + length * axis])
        ax.plot(*ends.T, color=color, linewidth=1.6, zorder=ON_TOP, solid_capstyle="butt",
                path_effects=[withStroke(linewidth=2.8, foreground="white")])  # fmt: skip
