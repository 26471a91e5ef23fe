"""One posture in space: object, arms, slices of its ellipsoid, and what stands around."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.patheffects import withStroke

from copose.poses import Array, rotation_rows
from copose.report import style
from copose.report.charts import legends
from copose.report.geometry.camera import best_view
from copose.report.geometry.free_ranges import object_axes, ranges
from copose.report.geometry.link_bodies import LinkBodies, LinkBody
from copose.report.geometry.obstacles import Body, bodies
from copose.report.geometry.shapes import faces
from copose.report.geometry.slices import Slice, angular_slice, linear_slice
from copose.report.geometry.view import View, frame, roomy
from copose.report.scene.polygons import Polygons
from copose.report.style import Drawn, Panel
from copose.results import EllipsoidRecord, Posture

# The longest semi-axis drawn, and how high the angular slice floats, as shares of the scene.
_ELLIPSE_SHARE = 0.18
_LIFT = 0.42
# Length of a tip's axes, alike.
_AXIS = 0.05
# Side of the pieces that are sorted by depth, alike.
PIECE = 0.07
# Opacity of the object.
_OBJECT = 0.3
# Opacity of obstacles.
_OBSTACLE = 0.4
# Opacity of ellipsoids.
_SLICE = 0.35
# Over all that is drawn by its depth.
ON_TOP = 1000


@dataclass(frozen=True)
class Kind:
    """One kind of slices, linear or angular, and how all of them are drawn."""

    name: str
    part: Callable[[EllipsoidRecord, Sequence[str]], Slice | None]
    color: str
    index: int
    scales: list[float]
    lift: float

    def of(self, panel: Panel) -> Slice | None:
        """A posture's slice."""
        return self.part(panel.posture.ellipsoid, panel.solution.problem.axes)

    def center(self, panel: Panel) -> Array:
        """Where it is drawn."""
        return np.asarray(panel.posture.object.position + np.array([0.0, 0.0, self.lift]))

    def unit(self, panel: Panel) -> str:
        """Of its semi-axes."""
        return style.units(panel.solution)[self.index]

    def units(self, panels: list[Panel]) -> list[str]:
        """Of all, each once."""
        return list(dict.fromkeys(self.unit(panel) for panel in panels))

    def words(self, panels: list[Panel]) -> str:
        """How long an acceleration is drawn."""
        where = ", lifted above the object" if self.lift else " at the object"
        drawn = []
        for unit, scale in {
            self.unit(p): s for p, s in zip(panels, self.scales, strict=True)
        }.items():
            value = style.round_scale(0.2 / scale)
            drawn.append(f"{value * scale:.2g} m drawn = {value:g} {unit}")
        return f"{self.name} slice{where}: {'; '.join(drawn)}"


def _kinds(panels: list[Panel], links: list[list[LinkBody]]) -> list[Kind]:
    """The slices that the postures have, each kind at one scale for all that share a unit."""
    low, high = roomy(_points(panels, []))
    size = float((high - low).max())
    kinds: list[Kind] = []
    for index, (name, part, color) in enumerate(
        (("linear", linear_slice, style.SYSTEM), ("angular", angular_slice, style.ANGULAR))
    ):
        found = [part(p.posture.ellipsoid, p.solution.problem.axes) for p in panels]
        longest = [float(each.ellipsoid.radii[0]) if each is not None else 0.0 for each in found]
        scales = style.scales(panels, longest, _ELLIPSE_SHARE * size)
        if scales is not None:
            # Where both are drawn the angular one floats above the other.
            lift = _lift(panels, links, found, scales, size) if kinds else 0.0
            kinds.append(Kind(name, part, color, index, scales, lift))
    return kinds


def _lift(
    panels: list[Panel], links: list[list[LinkBody]], slices: list[Slice | None],
    scales: list[float], size: float,
) -> float:  # fmt: skip
    """How high above the object slices float, m: clear of links that are in their way."""
    lift = _LIFT * size
    for panel, some, part, scale in zip(panels, links, slices, scales, strict=True):
        if part is not None and some:
            extent = np.abs(scale * part.surface.reshape(-1, 3)).max(axis=0)
            points = np.vstack([link.points for link in some])
            offset = points - np.array(panel.posture.object.position)
            above = (np.abs(offset) <= 1.1 * extent + [0, 0, np.inf])[:, :2].all(axis=1)
            lift = max(lift, offset[above, 2].max(initial=0.0) + 1.2 * extent[2])
    return lift


@dataclass(frozen=True, eq=False)
class Stage:
    """Axes that all scenes of a picture share.

    Attributes:
        kinds: the slices.
        low: the least x, y, z; ``high`` the largest.
        bodies: obstacles, by panel.
        links: bodies of the arms' links, alike; none where sticks are drawn.
        view: where all of them are seen from.
    """

    kinds: list[Kind]
    low: Array
    high: Array
    bodies: list[list[Body]]
    links: list[list[LinkBody]]
    view: View

    @classmethod
    def of(cls, panels: list[Panel]) -> Stage:
        """Where all of the panels have room."""
        robots = {id(p.solution): LinkBodies.of(p.solution.problem) for p in panels}
        links = [robots[id(panel.solution)].placed(panel.posture) for panel in panels]
        kinds = _kinds(panels, links)
        points = [_points(panels, kinds), *(link.points for some in links for link in some)]
        for panel in panels:
            points += [each.edges.reshape(-1, 3) for each in ranges(panel)]
        known = np.vstack(points)
        low, high = known.min(axis=0), known.max(axis=0)
        around = [bodies(panel.solution, low, high) for panel in panels]
        more = [body.points for each in around for body in each]
        scenes = [
            (mine, object_points(panel.posture, panel.solution))
            for panel, mine in zip(panels, links, strict=True)
        ]
        return cls(kinds, *roomy(np.vstack([known, *more])), around, links, best_view(scenes))

    def draw(self, ax: Any, panels: list[Panel], k: int, *, whole: bool = False) -> None:
        """The scene of one of the panels; ``whole`` as `frame` has it."""
        panel, size = panels[k], float((self.high - self.low).max())
        frame(ax, self.low, self.high, ("x, m", "y, m", "z, m"), self.view, whole=whole)
        polygons = Polygons(self.view, PIECE * size)
        for body in self.bodies[k]:
            draw_body(ax, polygons, body, self.view)
        draw_posture(ax, polygons, panel.posture, panel.solution, self.links[k], size)
        for kind in self.kinds:
            _draw_slice(ax, polygons, panel, kind, kind.scales[k])
            if panel.other is not None:
                _outline_slice(ax, panel.other, kind, kind.scales[k])
        polygons.draw(ax)
        _ranges(ax, panel)
        if panel.other is not None:
            ax.plot([], [], color=style.INK, linewidth=1, label=legends.OTHER)


def _points(panels: list[Panel], kinds: list[Kind]) -> Array:
    """Points of arms, objects and slices."""
    points = [posture_points(panel.posture, panel.solution) for panel in panels]
    for kind in kinds:
        for panel, scale in zip(panels, kind.scales, strict=True):
            part = kind.of(panel)
            if part is not None:
                points.append((kind.center(panel) + scale * part.surface).reshape(-1, 3))
    return np.vstack(points)


def posture_points(posture: Posture, solution: Drawn) -> Array:
    """Points of arms and object, (k, 3)."""
    points = [np.array([*arm.skeleton, arm.grasp]) for arm in posture.arms.values()]
    return np.vstack([*points, object_points(posture, solution)])


def object_points(posture: Posture, solution: Drawn) -> Array:
    """The object's corners and its centre of mass, (k, 3)."""
    return np.vstack([*_faces(posture, solution), posture.object.position])


def _faces(posture: Posture, solution: Drawn) -> list[Array]:
    """The object's surface as polygons in the world."""
    shape = solution.problem.shape
    if shape is None:
        return []
    return faces(shape, posture.object.position, object_axes(posture))


def draw_body(ax: Any, polygons: Polygons, body: Body, view: View) -> None:
    """An obstacle and its name, below it."""
    polygons.clear(body.faces, style.OBSTACLE, _OBSTACLE)
    if not body.round:
        polygons.edges(body.faces, style.OBSTACLE)
    lowest = body.points[np.argmin(body.points @ view.axes[1])]
    name = ax.text(*lowest, style.short(body.name), fontsize=8, color=style.INK, ha="center",
                   va="top", zorder=ON_TOP)  # fmt: skip
    name.set_path_effects([withStroke(linewidth=2, foreground="white")])


def draw_ghost(ax: Any, posture: Posture, solution: Drawn, strength: float) -> None:
    """Arms and object as they pass by."""
    for corners in _faces(posture, solution):
        rim = np.vstack([corners, corners[:1]])
        ax.plot(*rim.T, color=style.INK, linewidth=0.6, alpha=0.6 * strength)
    for name, color in style.arm_colors(posture).items():
        points = np.array(posture.arms[name].skeleton)
        ax.plot(*points.T, color=color, linewidth=2.5, alpha=strength, solid_capstyle="round",
                solid_joinstyle="round")  # fmt: skip


def draw_posture(
    ax: Any, polygons: Polygons, posture: Posture, solution: Drawn, links: Sequence[LinkBody],
    size: float,
) -> None:  # fmt: skip
    """Arms and object.

    Args:
        ax: where lines are drawn.
        polygons: which bodies are added to.
        posture: what is drawn.
        solution: whose it is.
        links: bodies of the arms; without any they are drawn as sticks.
        size: of the scene, m.
    """
    colors, thing = style.arm_colors(posture), _faces(posture, solution)
    for link in links:
        polygons.solid(link.faces, link.normals, style.BEFORE if link.arm is None
                       else colors[link.arm])  # fmt: skip
    polygons.clear(thing, style.OBJECT, _OBJECT)
    if solution.problem.shape is not None and solution.problem.shape.kind == "box":
        polygons.edges(thing)
    center = np.array(posture.object.position)
    ax.plot(*center[:, None], marker="o", markersize=4, color=style.INK)
    for name, color in colors.items():
        arm = posture.arms[name]
        points, grasp = np.array(arm.skeleton), np.array(arm.grasp)
        label = f"arm {style.short(name)}"
        if any(link.arm == name for link in links):
            ax.plot([], [], color=color, linewidth=4, label=label)
            _draw_axes(ax, points[-1], np.array(rotation_rows(arm.quaternions[-1])), _AXIS * size)
        else:
            _draw_stick(ax, points, color, label)
        if posture.closure_error[name] > style.OPEN:
            ax.plot(*np.array([points[-1], grasp]).T, color=style.INK, linestyle=":", linewidth=1.2,
                    zorder=ON_TOP)  # fmt: skip
            ax.plot(*grasp[:, None], marker="x", markersize=8, color=style.INK, zorder=ON_TOP)
        elif solution.problem.shape is None:
            ax.plot(*np.array([grasp, center]).T, color=style.OBJECT, linewidth=1.5)


def _draw_stick(ax: Any, points: Array, color: str, label: str) -> None:
    """An arm by its joints."""
    ax.plot(*points.T, color=color, linewidth=4, solid_capstyle="round", solid_joinstyle="round",
            label=label)  # fmt: skip
    ax.plot(*points[1:-1].T, linestyle="", marker="o", markersize=5, markerfacecolor="white",
            markeredgecolor=style.INK)  # fmt: skip
    ax.plot(*points[:1].T, marker="s", markersize=8, color=color)
    ax.plot(*points[-1:].T, marker="o", markersize=4, color=style.INK)


def _draw_axes(ax: Any, origin: Array, rotation: Array, length: float) -> None:
    """The axes x, y, z of a frame."""
    for axis, color in zip(rotation.T, style.AXES, strict=True):
        ends = np.array([origin, origin + length * axis])
        ax.plot(*ends.T, color=color, linewidth=1.6, zorder=ON_TOP, solid_capstyle="butt",
                path_effects=[withStroke(linewidth=2.8, foreground="white")])  # fmt: skip


def _ranges(ax: Any, panel: Panel) -> None:
    """Dashed boxes of what is free, over all else: the object's lies within it."""
    colors = style.arm_colors(panel.posture)
    found = ranges(panel)
    for each in found:
        color = style.INK if each.arm is None else colors[each.arm]
        for edge in each.edges:
            ax.plot(*edge.T, color=color, linewidth=1.2, linestyle=style.DASHES, zorder=ON_TOP,
                    marker="." if len(each.edges) == 1 else "")  # fmt: skip
    if found:
        ax.plot(*np.array(panel.posture.object.position)[:, None], marker="o", markersize=4,
                color=style.INK, zorder=ON_TOP)  # fmt: skip
        ax.plot([], [], color=style.INK, linewidth=1.2, linestyle=style.DASHES,
                label=legends.RANGES)  # fmt: skip


def _draw_slice(ax: Any, polygons: Polygons, panel: Panel, kind: Kind, scale: float) -> None:
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
        polygons.clear(quads, kind.color, _SLICE, normals)
    else:
        ax.plot(*points.T, color=kind.color, linewidth=3.5)
        fan = [np.array([center, *ends]) for ends in pairwise(points)]
        polygons.clear(fan if len(points) > 2 else [], kind.color, _SLICE)
    if kind.lift:
        stem = np.array([panel.posture.object.position, center])
        ax.plot(*stem.T, color=kind.color, linewidth=1, linestyle=":", zorder=ON_TOP)


def _outline_slice(ax: Any, panel: Panel, kind: Kind, scale: float) -> None:
    part = kind.of(panel)
    if part is None:
        return
    grid = np.moveaxis(kind.center(panel) + scale * part.surface, -1, 0)
    if grid.ndim == 3:
        ax.plot_wireframe(*grid, color=style.INK, linewidth=0.5, rstride=4, cstride=4)
    else:
        ax.plot(*grid, color=style.INK, linewidth=1.2, linestyle="--")
