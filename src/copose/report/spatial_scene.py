"""One posture in space: object, arms, slices of its ellipsoid, and what stands around."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.patheffects import withStroke
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from copose.poses import Array
from copose.report import legends, style
from copose.report.frames import frame, roomy, view_axes
from copose.report.ranges import object_axes, ranges
from copose.report.shapes import faces
from copose.report.slices import Slice, angular_slice, linear_slice
from copose.report.style import Drawn, Panel
from copose.report.surroundings import Body, bodies, link_points, links, silhouette
from copose.results import EllipsoidRecord, Posture

# The longest semi-axis drawn, and how high the angular slice floats, as shares of the scene.
_ELLIPSE_SHARE = 0.18
_LIFT = 0.42
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


def kinds_of(panels: list[Panel]) -> list[Kind]:
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
            kinds.append(Kind(name, part, color, index, scales, _LIFT * size if kinds else 0.0))
    return kinds


@dataclass(frozen=True, eq=False)
class Stage:
    """Axes that all scenes of a picture share.

    Attributes:
        kinds: the slices.
        low: the least x, y, z; ``high`` the largest.
        bodies: obstacles, by panel.
    """

    kinds: list[Kind]
    low: Array
    high: Array
    bodies: list[list[Body]]

    @classmethod
    def of(cls, panels: list[Panel]) -> Stage:
        """Where all of the panels have room."""
        kinds = kinds_of(panels)
        points = [_points(panels, kinds)]
        for panel in panels:
            points += [each.edges.reshape(-1, 3) for each in ranges(panel)]
            points.append(link_points(panel.posture))
        known = np.vstack(points)
        low, high = known.min(axis=0), known.max(axis=0)
        around = [bodies(panel.solution, low, high) for panel in panels]
        more = [body.points for each in around for body in each]
        return cls(kinds, *roomy(np.vstack([known, *more])), around)

    def draw(self, ax: Any, panels: list[Panel], k: int, *, whole: bool = False) -> None:
        """The scene of one of the panels; ``whole`` as `frame` has it."""
        panel = panels[k]
        for body in self.bodies[k]:
            draw_body(ax, body)
        draw_posture(ax, panel.posture, panel.solution)
        frame(ax, self.low, self.high, ("x, m", "y, m", "z, m"), whole=whole)
        for kind in self.kinds:
            _draw_slice(ax, panel, kind, kind.scales[k])
            if panel.other is not None:
                _draw_slice(ax, panel.other, kind, kind.scales[k], outline=True)
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
    return np.vstack([*points, *_faces(posture, solution), posture.object.position])


def _faces(posture: Posture, solution: Drawn) -> list[Array]:
    """The object's surface as polygons in the world."""
    shape = solution.problem.shape
    if shape is None:
        return []
    return faces(shape, posture.object.position, object_axes(posture))


def draw_body(ax: Any, body: Body) -> None:
    """An obstacle and its name, below it."""
    edge = (style.OBSTACLE, 0.2 if body.round else 1.0)
    solid = Poly3DCollection(body.faces, facecolors=(style.OBSTACLE, 0.25), edgecolors=edge,
                             linewidth=0.5)  # fmt: skip
    ax.add_collection3d(solid)
    lowest = body.points[np.argmin(body.points @ view_axes()[1])]
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


def draw_posture(ax: Any, posture: Posture, solution: Drawn) -> None:
    """Arms, object and what keeps them apart."""
    view = view_axes()
    for parts, color in links(posture).values():
        rims = [silhouette(part, part @ view[:2].T) for part in parts]
        # All of one length: of others the axes' limits would count what is not set.
        most = max(map(len, rims))
        rims = [each[np.minimum(np.arange(most), len(each) - 1)] for each in rims if len(each)]
        ax.add_collection3d(Poly3DCollection(rims, facecolor=color, alpha=0.12, linewidth=0))
    for corners in _faces(posture, solution):
        face = Poly3DCollection([corners], facecolor=style.OBJECT, edgecolor=style.INK,
                                linewidth=0.5, alpha=0.35)  # fmt: skip
        ax.add_collection3d(face)
    center = np.array(posture.object.position)
    ax.plot(*center[:, None], marker="o", markersize=4, color=style.INK)
    for name, color in style.arm_colors(posture).items():
        points = np.array(posture.arms[name].skeleton)
        ax.plot(*points.T, color=color, linewidth=4, solid_capstyle="round",
                solid_joinstyle="round", label=f"arm {style.short(name)}")  # fmt: skip
        ax.plot(*points[1:-1].T, linestyle="", marker="o", markersize=5, markerfacecolor="white",
                markeredgecolor=style.INK)  # fmt: skip
        ax.plot(*points[:1].T, marker="s", markersize=8, color=color)
        ax.plot(*points[-1:].T, marker="o", markersize=4, color=style.INK)
        grasp = np.array(posture.arms[name].grasp)
        if posture.closure_error[name] > style.OPEN:
            ax.plot(*np.array([points[-1], grasp]).T, color=style.INK, linestyle=":", linewidth=1.2)
            ax.plot(*grasp[:, None], marker="x", markersize=8, color=style.INK)
        elif solution.problem.shape is None:
            ax.plot(*np.array([grasp, center]).T, color=style.OBJECT, linewidth=1.5)


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


def _draw_slice(ax: Any, panel: Panel, kind: Kind, scale: float, outline: bool = False) -> None:
    part = kind.of(panel)
    if part is None:
        return
    center = kind.center(panel)
    points = center + scale * part.surface
    grid = np.moveaxis(points, -1, 0)
    if outline:
        if points.ndim == 3:
            ax.plot_wireframe(*grid, color=style.INK, linewidth=0.5, rstride=4, cstride=4)
        else:
            ax.plot(*grid, color=style.INK, linewidth=1.2, linestyle="--")
        return
    if points.ndim == 3:
        ax.plot_surface(*grid, color=kind.color, alpha=0.45, linewidth=0, rstride=1, cstride=1)
    else:
        ax.plot(*grid, color=kind.color, linewidth=3.5)
        ax.add_collection3d(Poly3DCollection([points], facecolor=kind.color, alpha=0.3))
    if kind.lift:
        stem = np.array([panel.posture.object.position, center])
        ax.plot(*stem.T, color=kind.color, linewidth=1, linestyle=":")
