"""Pictures of spatial postures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from copose.poses import Array, rotation_rows
from copose.problem import SPACES
from copose.report import style
from copose.report.exact_sets import draw_set, legend_below, set_pictures
from copose.report.forces import holding_arrows
from copose.report.frames import frame, roomy
from copose.report.shares import draw_shares, share_panels
from copose.report.slices import Slice, angular_slice, linear_slice
from copose.report.style import Panel
from copose.results import EllipsoidRecord, Posture, Solution

# The longest semi-axis drawn, and how high the angular slice floats, as shares of the scene.
_ELLIPSE_SHARE = 0.18
_LIFT = 0.42


@dataclass(frozen=True)
class _Kind:
    """One kind of slices, linear or angular, and how all of them are drawn."""

    name: str
    part: Callable[[EllipsoidRecord, Sequence[str]], Slice | None]
    color: str
    index: int
    scales: list[float]
    lift: float

    def of(self, panel: Panel) -> Slice | None:
        return self.part(panel.posture.ellipsoid, panel.solution.problem.axes)

    def center(self, panel: Panel) -> Array:
        return np.asarray(panel.posture.object.position + np.array([0.0, 0.0, self.lift]))

    def unit(self, panel: Panel) -> str:
        return style.units(panel.solution)[self.index]

    def units(self, panels: list[Panel]) -> list[str]:
        return list(dict.fromkeys(self.unit(panel) for panel in panels))


def spatial_figure(panels: list[Panel], heading: str) -> Figure:
    """Scenes with the ellipsoid's linear and angular slices, and their semi-axes as bars.

    Beside them what torque limits allow, where the results say so: exact sets and shares.
    """
    kinds, sets, holding = _kinds(panels), set_pictures(panels), share_panels(panels)
    # Shares stand beside the semi-axes where exact sets make the picture wide, else below them.
    apart = bool(holding) and not (sets and kinds)
    rows = [3.6] + [1.0] * bool(kinds) + [1.0] * apart
    count = len(panels) + len(sets)
    tall = 4.2 + 2.0 * len(rows) + 0.6 * bool(sets or apart)
    figure = Figure(figsize=(5.5 * max(count, 2), tall))
    grid = figure.add_gridspec(
        len(rows), 2 * len(panels), height_ratios=rows, left=0.03, right=0.94,
        bottom=0.08 if holding else 0.06, top=0.88, hspace=0.3 if sets or apart else 0.16,
        wspace=0.3,
    )  # fmt: skip
    places = [grid[0, 2 * k : 2 * k + 2] for k in range(len(panels))]
    span = 2 * len(panels) // max(len(kinds), 1)
    bars = [grid[1, span * k : span * (k + 1)] for k in range(len(kinds))]
    if sets:
        top = grid[0, :].subgridspec(1, count, wspace=0.2)
        places = [top[0, k] for k in range(count)]
    if apart:
        bars.append(grid[-1, :])
    elif holding:
        parts = [1] * len(kinds) + [2]
        below = grid[1, :].subgridspec(1, len(parts), width_ratios=parts, wspace=0.16)
        bars = [below[0, k] for k in range(len(parts))]
    low, high = _extent(panels, kinds)
    for k, panel in enumerate(panels):
        ax: Any = figure.add_subplot(places[k], projection="3d")
        _scene(ax, panel.posture, panel.solution)
        frame(ax, low, high, ("x, m", "y, m", "z, m"))
        for kind in kinds:
            _draw_slice(ax, panel, kind, kind.scales[k])
            if panel.other is not None:
                _draw_slice(ax, panel.other, kind, kind.scales[k], outline=True)
        if panel.other is not None:
            ax.plot([], [], color=style.INK, linewidth=1, label="the other one's ellipsoids")
        if sets:
            _forces(ax, *holding_arrows(panel.posture, float((high - low).max())))
            legend_below(ax, *ax.get_legend_handles_labels(), columns=2, points=8)
        else:
            ax.legend(loc="upper right", frameon=False, fontsize=9)
        ax.set_title(_title(panel), loc="left", y=0.96 if sets else 0.99)
    for each, place in zip(sets, places[len(panels) :], strict=True):
        draw_set(figure, place, each, columns=3)
    for kind, place in zip(kinds, bars, strict=False):
        _bars(figure.add_subplot(place), panels, kind)
    if holding:
        draw_shares(figure.add_subplot(bars[-1]), holding, named=len(panels) > 1)
    figure.suptitle(heading, fontweight="bold", x=0.02, y=0.985, ha="left")
    for k, kind in enumerate(kinds):
        where = ", lifted above the object" if kind.lift else " at the object"
        drawn = []
        for unit, scale in {
            kind.unit(p): s for p, s in zip(panels, kind.scales, strict=True)
        }.items():
            value = style.round_scale(0.2 / scale)
            drawn.append(f"{value * scale:.2g} m drawn = {value:g} {unit}")
        figure.text(
            0.02, 0.935 - 0.024 * k,
            f"{kind.name} slice{where}: {'; '.join(drawn)}", fontsize=9.5, color=kind.color,
        )  # fmt: skip
    return figure


def _kinds(panels: list[Panel]) -> list[_Kind]:
    """The slices that the postures have, each kind at one scale for all that share a unit."""
    low, high = _extent(panels, [])
    size = float((high - low).max())
    kinds: list[_Kind] = []
    for index, (name, part, color) in enumerate(
        (("linear", linear_slice, style.SYSTEM), ("angular", angular_slice, style.ANGULAR))
    ):
        found = [part(p.posture.ellipsoid, p.solution.problem.axes) for p in panels]
        longest = [float(each.ellipsoid.radii[0]) if each is not None else 0.0 for each in found]
        scales = style.scales(panels, longest, _ELLIPSE_SHARE * size)
        if scales is not None:
            # Where both are drawn the angular one floats above the other.
            kinds.append(_Kind(name, part, color, index, scales, _LIFT * size if kinds else 0.0))
    return kinds


def _title(panel: Panel) -> str:
    name, posture, solution = panel.name, panel.posture, panel.solution
    if name == style.MISS:
        unit = "m or rad" if SPACES[solution.problem.space].rigid else "m"
        return f"{name}: gap {max(posture.closure_error.values()):.3g} {unit}"
    return f"{name}: {style.value_words(solution, posture)}"


def _bars(ax: Axes, panels: list[Panel], kind: _Kind) -> None:
    width = 0.8 / len(panels)
    count = 1
    units = kind.units(panels)
    for k, panel in enumerate(panels):
        part = kind.of(panel)
        if part is None:
            continue
        radii = part.ellipsoid.radii
        count = max(count, len(radii))
        # Heights are lengths as drawn: panels with a unit of their own have a scale of their own.
        drawn = ax.bar(
            np.arange(len(radii)) + (k - (len(panels) - 1) / 2) * width,
            radii * kind.scales[k], width * 0.92,
            color=style.BEFORE if k + 1 < len(panels) else kind.color,
            label=style.short(panel.name) + (f", {kind.unit(panel)}" if len(units) > 1 else ""),
        )  # fmt: skip
        ax.bar_label(drawn, [f"{radius:.3g}" for radius in radii], fontsize=9, padding=1)
    words = {1: [""], 2: ["longest", "shortest"], 3: ["longest", "middle", "shortest"]}
    ax.set_xticks(np.arange(count), words[count])
    ax.margins(y=0.15)
    ax.set_yticks([])
    for side in ("top", "right", "left"):
        ax.spines[side].set_visible(False)
    title = f"semi-axes of the {kind.name} slice" + (f", {units[0]}" if len(units) == 1 else "")
    ax.set_title(title, fontsize=10, color=kind.color, loc="left", pad=20)
    if len(panels) > 1:
        ax.legend(frameon=False, fontsize=9, loc="lower left", bbox_to_anchor=(0, 0.98),
                  ncols=len(panels), borderaxespad=0.1)  # fmt: skip


def _scene(ax: Any, posture: Posture, solution: Solution) -> None:
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


def _forces(ax: Any, arrows: list[tuple[Array, Array]], words: str) -> None:
    """Arrows from tail to head, and what they are."""
    for tail, head in arrows:
        ax.quiver(*tail, *(head - tail), color=style.INK, linewidth=1.8, arrow_length_ratio=0.3)
    if arrows:
        ax.plot([], [], color=style.INK, linewidth=1.8, label=words)


def _draw_slice(ax: Any, panel: Panel, kind: _Kind, scale: float, outline: bool = False) -> None:
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


def _faces(posture: Posture, solution: Solution) -> list[Array]:
    """The object's surface as polygons in the world."""
    shape = solution.problem.shape
    if shape is None:
        return []
    if shape.kind == "box":
        local = _box(np.array(shape.size) / 2)
    elif shape.kind == "sphere":
        local = _tube(shape.radius * np.sin(_HALF), shape.radius * np.cos(_HALF))
    else:
        length = shape.length / 2  # type: ignore[union-attr]
        local = _tube(
            np.array([0.0, shape.radius, shape.radius, 0.0]),
            np.array([-length, -length, length, length]),
        )
    quaternion = posture.object.quaternion  # type: ignore[union-attr]
    R: Array = np.array(rotation_rows(quaternion))
    return [np.array(posture.object.position) + face @ R.T for face in local]


_HALF = np.linspace(0, np.pi, 7)


def _box(half: Array) -> list[Array]:
    faces = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
            faces.append(np.insert(corners, axis, sign, axis=1) * half)
    return faces


def _tube(radii: Array, heights: Array) -> list[Array]:
    """A surface of revolution about z, as quadrilaterals."""
    angle = np.linspace(0, 2 * np.pi, 17)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    faces = []
    for (r0, r1), (z0, z1) in zip(pairwise(radii), pairwise(heights), strict=True):
        for a, b in pairwise(ring):
            faces.append(np.array([[*a * r0, z0], [*b * r0, z0], [*b * r1, z1], [*a * r1, z1]]))
    return faces


def _extent(panels: list[Panel], kinds: list[_Kind]) -> tuple[Array, Array]:
    postures = [panel.posture for panel in panels]
    points = [np.array([*a.skeleton, a.grasp]) for p in postures for a in p.arms.values()]
    points += [np.vstack(faces) for p in panels if (faces := _faces(p.posture, p.solution))]
    points += [np.array([p.object.position]) for p in postures]
    for kind in kinds:
        for panel, scale in zip(panels, kind.scales, strict=True):
            part = kind.of(panel)
            if part is not None:
                points.append((kind.center(panel) + scale * part.surface).reshape(-1, 3))
    return roomy(np.vstack(points))
