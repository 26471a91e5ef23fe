"""Pictures of spatial postures."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from copose.capability import Ellipsoid
from copose.poses import Array, rotation_rows
from copose.problem import SPACES
from copose.report import style
from copose.results import Posture, Solution

# The longest semi-axis drawn, and how high the angular slice floats, as shares of the scene.
_ELLIPSE_SHARE = 0.18
_LIFT = 0.42


@dataclass(frozen=True)
class _Slice:
    """One coordinate slice of the ellipsoids and how it is drawn."""

    kind: str
    rows: tuple[int, ...]
    color: str
    unit: str
    scale: float
    lift: float

    def of(self, posture: Posture) -> Ellipsoid | None:
        ellipsoid = posture.ellipsoid.value
        return None if ellipsoid is None else ellipsoid.sliced(self.rows)

    def center(self, posture: Posture) -> Array:
        return np.asarray(posture.object.position + np.array([0.0, 0.0, self.lift]))


def spatial_figure(solution: Solution) -> Figure:
    """Scenes with the ellipsoid's linear and angular slices, and their semi-axes as bars."""
    panels = style.panels(solution)
    postures = [posture for _, posture in panels]
    slices = _slices(solution, postures)
    figure = Figure(figsize=(11, 8.2 if slices else 6.2))
    grid = figure.add_gridspec(
        2 if slices else 1, 2 * len(panels), height_ratios=[3.6, 1] if slices else [1],
        left=0.03, right=0.94, bottom=0.06, top=0.88, hspace=0.16, wspace=0.3,
    )  # fmt: skip
    low, high = _extent(postures, solution, slices)
    for k, (name, posture) in enumerate(panels):
        ax: Any = figure.add_subplot(grid[0, 2 * k : 2 * k + 2], projection="3d")
        _scene(ax, posture, solution, low, high)
        for piece in slices:
            _draw_slice(ax, posture, piece)
        ax.set_title(_title(name, posture, solution), loc="left", y=0.99)
    span = 2 * len(panels) // max(len(slices), 1)
    for k, piece in enumerate(slices):
        bars = figure.add_subplot(grid[1, span * k : span * (k + 1)])
        _bars(bars, panels, piece)
    figure.suptitle(style.heading(solution), fontweight="bold", x=0.02, y=0.985, ha="left")
    for k, piece in enumerate(slices):
        value = style.round_scale(0.2 / piece.scale)
        where = ", lifted above the object" if piece.lift else " at the object"
        drawn = f"{value * piece.scale:.2g} m drawn = {value:g} {piece.unit}"
        figure.text(
            0.02, 0.935 - 0.024 * k,
            f"{piece.kind} slice{where}: {drawn}", fontsize=9.5, color=piece.color,
        )  # fmt: skip
    return figure


def _slices(solution: Solution, postures: list[Posture]) -> list[_Slice]:
    """The slices that the postures have, at one scale for all of them."""
    space = SPACES[solution.problem.space]
    low, high = _extent(postures, solution, [])
    size = float((high - low).max())
    kinds = [
        ("linear", space.linear, style.SYSTEM, style.LINEAR_UNIT, 0.0),
        ("angular", space.angular, style.ANGULAR, style.ANGULAR_UNIT, _LIFT * size),
    ]
    slices = []
    for kind, rows, color, unit, lift in kinds:
        ellipsoids = [p.ellipsoid.value for p in postures]
        radii = [float(e.sliced(rows).radii[0]) for e in ellipsoids if e is not None and rows]
        if radii:
            slices.append(_Slice(kind, rows, color, unit, _ELLIPSE_SHARE * size / max(radii), lift))
    return slices


def _title(name: str, posture: Posture, solution: Solution) -> str:
    record = posture.ellipsoid
    if record.log_volume is not None:
        return f"{name}: log-volume {record.log_volume:.3f}"
    unit = "m or rad" if SPACES[solution.problem.space].rigid else "m"
    if name == "nearest miss":
        return f"{name}: gap {max(posture.closure_error.values()):.3g} {unit}"
    return f"{name}: volume 0"


def _bars(ax: Axes, panels: list[tuple[str, Posture]], piece: _Slice) -> None:
    places = np.arange(len(piece.rows))
    width = 0.8 / len(panels)
    top = 0.0
    for k, (name, posture) in enumerate(panels):
        ellipsoid = piece.of(posture)
        radii = ellipsoid.radii if ellipsoid is not None else np.zeros(len(piece.rows))
        drawn = ax.bar(
            places + (k - (len(panels) - 1) / 2) * width, radii, width * 0.92,
            color=style.BEFORE if name == "before" else piece.color, label=name,
        )  # fmt: skip
        ax.bar_label(drawn, fmt="%.3g", fontsize=9, padding=1)
        top = max(top, float(radii.max()))
    ax.set_xticks(places, ["longest", "middle", "shortest"][: len(piece.rows)])
    ax.set_ylim(0, top * 1.25)
    ax.set_yticks([])
    for side in ("top", "right", "left"):
        ax.spines[side].set_visible(False)
    if len(panels) > 1:
        ax.legend(frameon=False, fontsize=9)
    ax.set_title(f"semi-axes of the {piece.kind} slice, {piece.unit}", fontsize=10,
                 color=piece.color)  # fmt: skip


def _scene(ax: Any, posture: Posture, solution: Solution, low: Array, high: Array) -> None:
    for corners in _faces(posture, solution):
        face = Poly3DCollection([corners], facecolor=style.OBJECT, edgecolor=style.INK,
                                linewidth=0.5, alpha=0.35)  # fmt: skip
        ax.add_collection3d(face)
    center = np.array(posture.object.position)
    ax.plot(*center[:, None], marker="o", markersize=4, color=style.INK)
    for name, color in zip(posture.arms, style.ARMS * len(posture.arms), strict=False):
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
    ax.set_xlim(low[0], high[0])
    ax.set_ylim(low[1], high[1])
    ax.set_zlim(low[2], high[2])
    ax.set_box_aspect(high - low, zoom=1.0)
    ax.view_init(elev=18, azim=-62)
    ax.locator_params(nbins=4)
    ax.tick_params(labelsize=8, pad=-1)
    ax.set_xlabel("x, m", labelpad=0)
    ax.set_ylabel("y, m", labelpad=-2)
    ax.set_zlabel("z, m", labelpad=1)
    ax.legend(loc="upper right", frameon=False, fontsize=9)


def _draw_slice(ax: Any, posture: Posture, piece: _Slice) -> None:
    ellipsoid = piece.of(posture)
    if ellipsoid is None:
        return
    around, down = np.linspace(0, 2 * np.pi, 33), np.linspace(0, np.pi, 17)
    sphere = np.stack(
        [
            np.outer(np.cos(around), np.sin(down)),
            np.outer(np.sin(around), np.sin(down)),
            np.outer(np.ones_like(around), np.cos(down)),
        ],
        axis=-1,
    )
    center = piece.center(posture)
    x, y, z = np.moveaxis(center + piece.scale * ellipsoid.boundary(sphere), -1, 0)
    ax.plot_surface(x, y, z, color=piece.color, alpha=0.45, linewidth=0, rstride=1, cstride=1)
    if piece.lift:
        stem = np.array([posture.object.position, center])
        ax.plot(*stem.T, color=piece.color, linewidth=1, linestyle=":")


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


def _extent(
    postures: list[Posture], solution: Solution, slices: list[_Slice]
) -> tuple[Array, Array]:
    points = [np.array([*a.skeleton, a.grasp]) for p in postures for a in p.arms.values()]
    points += [np.vstack(faces) for p in postures if (faces := _faces(p, solution))]
    points += [np.array([p.object.position]) for p in postures]
    for piece in slices:
        for posture in postures:
            ellipsoid = piece.of(posture)
            if ellipsoid is not None:
                reach = piece.scale * np.array([ellipsoid.support(axis) for axis in np.eye(3)])
                center = piece.center(posture)
                points.append(np.array([center - reach, center + reach]))
    stacked = np.vstack(points)
    low, high = stacked.min(axis=0), stacked.max(axis=0)
    size = float((high - low).max())
    # A flat scene still needs a box to be drawn in.
    thin = np.maximum(0.35 * size - (high - low), 0.0) / 2
    return low - thin - 0.03 * size, high + thin + 0.03 * size
