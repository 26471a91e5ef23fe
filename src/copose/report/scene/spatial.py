"""Scenes in space: object, arms, slices of ellipsoids, obstacles, and free ranges."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.patheffects import withStroke

from copose.poses import Array, rotation_rows
from copose.report.charts.legends import Entry
from copose.report.geometry.camera import View, best_view, frame, roomy
from copose.report.geometry.hulls import LinkBodies, LinkBody
from copose.report.geometry.shapes import (
    DrawnObstacle,
    near_obstacles,
    object_faces,
    object_points,
    ranges,
    spatial_points,
)
from copose.report.geometry.slices import Slice, angular_slice, linear_slice
from copose.report.look import LOOK, arm_colors
from copose.report.panels import Drawn, Panel, holds, shared_scales
from copose.report.scene.planar import draw_ranges
from copose.report.scene.polygons import ON_TOP, Polygons
from copose.report.words import round_scale, semi_axis_units, short
from copose.results import EllipsoidRecord, Posture


@dataclass(frozen=True)
class SliceLook:
    """Sizes of slices, as shares of the scene, and their opacity."""

    longest: float = 0.18  # the longest semi-axis
    lift: float = 0.42  # height at which angular slices float above linear ones, at least
    opacity: float = 0.35


@dataclass(frozen=True)
class SliceKind:
    """One kind of slices of all panels, linear or angular, as they are drawn."""

    name: str  # linear or angular
    # The function that takes the slice of an ellipsoid.
    part: Callable[[EllipsoidRecord, Sequence[str]], Slice | None]
    color: str
    index: int  # place of its unit among those of semi-axes
    scales: list[float]  # metres drawn per unit, by panel
    lift: float  # height above the object at which it floats, m

    def of(self, panel: Panel) -> Slice | None:
        """A posture's slice."""
        return self.part(panel.posture.ellipsoid, panel.solution.problem.axes)

    def center(self, panel: Panel) -> Array:
        """The place of its centre in a panel."""
        return np.asarray(panel.posture.object.position + np.array([0.0, 0.0, self.lift]))

    def unit(self, panel: Panel) -> str:
        """The unit of its semi-axes in a panel."""
        return semi_axis_units(panel.solution)[self.index]

    def units(self, panels: list[Panel]) -> list[str]:
        """The units of its semi-axes in all panels, each once."""
        return list(dict.fromkeys(self.unit(panel) for panel in panels))

    def words(self, panels: list[Panel]) -> str:
        """A line on the length at which accelerations are drawn."""
        where = ", lifted above the object" if self.lift else " at the object"
        drawn = []
        for unit, scale in {
            self.unit(p): s for p, s in zip(panels, self.scales, strict=True)
        }.items():
            value = round_scale(0.2 / scale)
            drawn.append(f"{value * scale:.2g} m drawn = {value:g} {unit}")
        return f"{self.name} slice{where}: {'; '.join(drawn)}"


def slice_kinds(panels: list[Panel], links: list[list[LinkBody]]) -> list[SliceKind]:
    """The kinds of slices that postures have, each at one scale for all that share a unit."""
    low, high = roomy(drawn_points(panels, []))
    size = float((high - low).max())
    kinds: list[SliceKind] = []
    for index, (name, part, color) in enumerate(
        (("linear", linear_slice, LOOK.system), ("angular", angular_slice, LOOK.angular))
    ):
        slices = [part(p.posture.ellipsoid, p.solution.problem.axes) for p in panels]
        longest = [0.0 if each is None else float(each.ellipsoid.radii[0]) for each in slices]
        scales = shared_scales(panels, longest, SliceLook.longest * size)
        if scales is not None:
            # Where both are drawn the angular one floats above the other.
            lift = _lift(panels, links, slices, scales, size, SliceLook.lift) if kinds else 0.0
            kinds.append(SliceKind(name, part, color, index, scales, lift))
    return kinds


def _lift(
    panels: list[Panel], links: list[list[LinkBody]], slices: list[Slice | None],
    scales: list[float], size: float, share: float,
) -> float:  # fmt: skip
    """The height above the object at which slices float, m: clear of links in their way."""
    lift = share * size
    for panel, bodies, part, scale in zip(panels, links, slices, scales, strict=True):
        if part is not None and bodies:
            extent = np.abs(scale * part.surface.reshape(-1, 3)).max(axis=0)
            points = np.vstack([link.points for link in bodies])
            offset = points - np.array(panel.posture.object.position)
            above = (np.abs(offset) <= 1.1 * extent + [0, 0, np.inf])[:, :2].all(axis=1)
            lift = max(lift, offset[above, 2].max(initial=0.0) + 1.2 * extent[2])
    return lift


def drawn_points(panels: list[Panel], kinds: list[SliceKind]) -> Array:
    """Points of arms, objects and slices, (k, 3)."""
    points = [spatial_points(panel.posture, panel.solution) for panel in panels]
    for kind in kinds:
        for panel, scale in zip(panels, kind.scales, strict=True):
            part = kind.of(panel)
            if part is not None:
                points.append((kind.center(panel) + scale * part.surface).reshape(-1, 3))
    return np.vstack(points)


def draw_slice(
    ax: Any, polygons: Polygons, panel: Panel, kind: SliceKind, scale: float,
) -> None:  # fmt: skip
    """The slice of a panel, with a stem to the object where it floats above it."""
    part = kind.of(panel)
    if part is None:
        return
    center = kind.center(panel)
    points = center + scale * part.surface
    if points.ndim == 3:
        quads = np.stack([points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]], 2)
        quads = quads.reshape(-1, 4, 3)
        normals = np.zeros_like(quads[:, 0])
        world = list(part.world)
        normals[:, world] = (quads.mean(axis=1) - center)[:, world] @ part.ellipsoid.gram
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        polygons.clear(quads, kind.color, SliceLook.opacity, normals)
    else:
        ax.plot(*points.T, color=kind.color, linewidth=3.5)
        fan = [np.array([center, *ends]) for ends in pairwise(points)]
        polygons.clear(fan if len(points) > 2 else [], kind.color, SliceLook.opacity)
    if kind.lift:
        stem = np.array([panel.posture.object.position, center])
        ax.plot(*stem.T, color=kind.color, linewidth=1, linestyle=":", zorder=ON_TOP)


def outline_slice(ax: Any, panel: Panel, kind: SliceKind, scale: float) -> None:
    """The slice of another panel as an outline."""
    part = kind.of(panel)
    if part is None:
        return
    grid = np.moveaxis(kind.center(panel) + scale * part.surface, -1, 0)
    if grid.ndim == 3:
        ax.plot_wireframe(*grid, color=LOOK.ink, linewidth=0.5, rstride=4, cstride=4)
    else:
        ax.plot(*grid, color=LOOK.ink, linewidth=1.2, linestyle="--")


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
        polygons = draw_posture(
            ax, self.view, size, panel.posture, panel.solution, self.links[k], self.bodies[k]
        )
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


def _draw_body(ax: Any, polygons: Polygons, body: DrawnObstacle, view: View) -> None:
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
    ax: Any, view: View, size: float, posture: Posture, solution: Drawn,
    links: Sequence[LinkBody], bodies: Sequence[DrawnObstacle],
) -> Polygons:  # fmt: skip
    """Obstacles, arms, as sticks where no bodies of their links are given, and the object, in axes
    of a size, m.

    Returns:
        The polygons, still to be drawn.
    """
    polygons = Polygons(view, size)
    for body in bodies:
        _draw_body(ax, polygons, body, view)
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
    return polygons


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
