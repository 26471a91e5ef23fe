"""Pictures of spatial postures."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from copose.capability import Ellipsoid
from copose.poses import Array
from copose.problem import SPACES
from copose.report import style
from copose.results import Posture, Solution

_ELLIPSE_SHARE = 0.22


def spatial_figure(solution: Solution) -> Figure:
    """Scenes with the ellipsoid's linear and angular slices, and their semi-axes as bars."""
    panels = style.panels(solution)
    space = SPACES[solution.problem.space]
    kinds = [("linear", space.linear, style.SYSTEM, style.LINEAR_UNIT)]
    if space.angular:
        kinds.append(("angular", space.angular, style.ANGULAR, style.ANGULAR_UNIT))
    measured = any(posture.ellipsoid.value is not None for _, posture in panels)
    figure = Figure(figsize=(10, 7.6 if measured else 5.2))
    grid = figure.add_gridspec(
        2 if measured else 1,
        2 * len(panels),
        height_ratios=[3.1, 1] if measured else [1],
        left=0.07, right=0.98, bottom=0.09, top=0.88, hspace=0.16, wspace=0.5,
    )  # fmt: skip
    low, high = _extent([posture for _, posture in panels], solution)
    scales = {
        kind: _ELLIPSE_SHARE * float((high - low).max()) / _longest(panels, rows)
        for kind, rows, _, _ in kinds
    }
    for k, (name, posture) in enumerate(panels):
        ax: Any = figure.add_subplot(grid[0, 2 * k : 2 * k + 2], projection="3d")
        _scene(ax, posture, solution, low, high)
        ellipsoid = posture.ellipsoid.value
        for kind, rows, color, _ in kinds:
            if ellipsoid is None:
                break
            _draw_ellipsoid(
                ax, np.array(posture.object.position), ellipsoid.sliced(rows), scales[kind], color,
                solid=kind == "linear",
            )  # fmt: skip
        ax.set_title(_title(name, posture, solution), loc="left", y=0.99)
    if measured:
        span = 2 * len(panels) // len(kinds)
        for k, (kind, rows, color, unit) in enumerate(kinds):
            ax = figure.add_subplot(grid[1, span * k : span * (k + 1)])
            _bars(ax, panels, rows, color)
            ax.set_title(f"semi-axes of the {kind} slice, {unit}", fontsize=10, color=color)
    heading = ": ".join(
        part for part in (solution.problem.name, style.gain_words(solution)) if part
    )
    figure.suptitle(heading, fontweight="bold", x=0.02, y=0.985, ha="left")
    if measured:
        figure.text(0.02, 0.925, _key(solution, scales, kinds), fontsize=9, color=style.INK)
    return figure


def _key(solution: Solution, scales: dict[str, float], kinds: list[Any]) -> str:
    texts = []
    for kind, _, _, unit in kinds:
        value = style.round_scale(0.2 / scales[kind])
        look = "solid" if kind == "linear" else "mesh"
        drawn = f"{value * scales[kind]:.2g} m"
        texts.append(f"{look}: {kind} slice, {value:g} {unit} drawn {drawn} long")
    return "   ".join(texts)


def _title(name: str, posture: Posture, solution: Solution) -> str:
    record = posture.ellipsoid
    if record.log_volume is not None:
        return f"{name}: log-volume {record.log_volume:.3f}"
    if name == "nearest miss":
        return f"{name}: gap {max(posture.closure_error.values()):.3g}"
    return f"{name}: volume 0"


def _longest(panels: list[tuple[str, Posture]], rows: tuple[int, ...]) -> float:
    ellipsoids = [posture.ellipsoid.value for _, posture in panels]
    return max((float(e.sliced(rows).radii[0]) for e in ellipsoids if e is not None), default=1.0)


def _bars(ax: Any, panels: list[tuple[str, Posture]], rows: tuple[int, ...], color: str) -> None:
    places = np.arange(len(rows))
    width = 0.8 / len(panels)
    top = 0.0
    for k, (name, posture) in enumerate(panels):
        ellipsoid = posture.ellipsoid.value
        radii = ellipsoid.sliced(rows).radii if ellipsoid is not None else np.zeros(len(rows))
        fill = style.BEFORE if name == "before" else color
        drawn = ax.bar(places + (k - (len(panels) - 1) / 2) * width, radii, width * 0.92,
                       color=fill, label=name)  # fmt: skip
        ax.bar_label(drawn, fmt="%.3g", fontsize=9, padding=1)
        top = max(top, float(radii.max()))
    ax.set_xticks(places, ["longest", "middle", "shortest"][: len(rows)])
    ax.set_ylim(0, top * 1.25)
    ax.set_yticks([])
    for side in ("top", "right", "left"):
        ax.spines[side].set_visible(False)
    if len(panels) > 1:
        ax.legend(frameon=False, fontsize=9)


def _scene(ax: Any, posture: Posture, solution: Solution, low: Array, high: Array) -> None:
    for corners in _faces(posture, solution):
        face = Poly3DCollection([corners], facecolor=style.OBJECT, edgecolor=style.INK,
                                linewidth=0.5, alpha=0.35)  # fmt: skip
        ax.add_collection3d(face)
    for name, color in zip(posture.arms, style.ARMS * len(posture.arms), strict=False):
        points = np.array(posture.arms[name].skeleton)
        ax.plot(*points.T, color=color, linewidth=4, solid_capstyle="round",
                solid_joinstyle="round", label=name)  # fmt: skip
        ax.plot(*points[1:-1].T, linestyle="", marker="o", markersize=5, markerfacecolor="white",
                markeredgecolor=style.INK)  # fmt: skip
        ax.plot(*points[:1].T, marker="s", markersize=8, color=color)
        ax.plot(*points[-1:].T, marker="o", markersize=4, color=style.INK)
    ax.set_xlim(low[0], high[0])
    ax.set_ylim(low[1], high[1])
    ax.set_zlim(low[2], high[2])
    ax.set_box_aspect(high - low, zoom=1.15)
    ax.view_init(elev=20, azim=-60)
    ax.locator_params(nbins=4)
    ax.tick_params(labelsize=8, pad=-1)
    ax.set_xlabel("x, m", labelpad=-2)
    ax.set_ylabel("y, m", labelpad=-2)
    ax.set_zlabel("z, m", labelpad=-4)
    ax.legend(loc="upper right", frameon=False, fontsize=9)


def _draw_ellipsoid(
    ax: Any, center: Array, ellipsoid: Ellipsoid, scale: float, color: str, solid: bool
) -> None:
    around = np.linspace(0, 2 * np.pi, 33)
    down = np.linspace(0, np.pi, 17)
    sphere = np.stack(
        [
            np.outer(np.cos(around), np.sin(down)),
            np.outer(np.sin(around), np.sin(down)),
            np.outer(np.ones_like(around), np.cos(down)),
        ],
        axis=-1,
    )
    points = center + scale * ellipsoid.boundary(sphere)
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    if solid:
        ax.plot_surface(x, y, z, color=color, alpha=0.45, linewidth=0, rstride=1, cstride=1)
    else:
        ax.plot_wireframe(x, y, z, color=color, linewidth=0.6, alpha=0.7, rstride=2, cstride=2)


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
    w, x, y, z = posture.object.quaternion  # type: ignore[union-attr]
    R = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
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


def _extent(postures: list[Posture], solution: Solution) -> tuple[Array, Array]:
    points = [np.array(arm.skeleton) for p in postures for arm in p.arms.values()]
    points += [np.vstack(faces) for p in postures if (faces := _faces(p, solution))]
    points += [np.array([p.object.position]) for p in postures]
    stacked = np.vstack(points)
    low, high = stacked.min(axis=0), stacked.max(axis=0)
    size = float((high - low).max())
    # A flat scene still needs a box to be drawn in.
    thin = np.maximum(0.35 * size - (high - low), 0.0) / 2
    return low - thin - 0.03 * size, high + thin + 0.03 * size
