"""Pictures of planar postures."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon
from matplotlib.transforms import ScaledTranslation

from copose.capability import Ellipsoid
from copose.poses import Array
from copose.problem import SPACES
from copose.report import style
from copose.results import EllipsoidRecord, Posture, Solution

# The longest semi-axis drawn, as a share of the scene's larger side.
_ELLIPSE_SHARE = 0.3
# Width of a panel, inches.
_PANEL = 4.6


def planar_figure(solution: Solution) -> Figure:
    """Postures side by side at one scale, with every arm's own ellipse and the system's."""
    panels = style.panels(solution)
    low, high = _extent(solution, [posture for _, posture in panels])
    size = float((high - low).max())
    longest = max((float(e.radii[0]) for _, p in panels for e in _ellipses(p, solution)), default=1)
    scale = _ELLIPSE_SHARE * size / longest
    for _, posture in panels:
        low, high = _grown(low, high, posture, solution, scale)
    # A flat scene still needs a frame to be read in.
    least = 0.4 * float((high - low).max())
    margin = 0.04 * size + np.maximum(least - (high - low), 0.0) / 2
    low, high = low - margin, high + margin

    width, height = high - low
    wide = _PANEL * len(panels) + 0.6
    keys = style.keys(solution.joint_names, "together, at the object", "each arm alone, at its tip")
    columns, rows = style.legend_grid(keys, wide)
    above, below = 1.0, 0.3 + 0.27 * rows
    tall = min(_PANEL * height / width + above, 7.5) + below
    figure = Figure(figsize=(wide, tall))
    axes = figure.subplots(1, len(panels), squeeze=False, sharex=True, sharey=True)[0]
    for ax, (name, posture) in zip(axes, panels, strict=True):
        _scene(ax, posture, solution, scale)
        ax.set_title(_title(name, posture, solution), loc="left")
        ax.set_xlim(low[0], high[0])
        ax.set_ylim(low[1], high[1])
        ax.set_aspect("equal")
        ax.set_xlabel("x, m")
    axes[0].set_ylabel("y, m")
    if any(_ellipses(posture, solution) for _, posture in panels):
        _scale_bar(axes[-1], low, high, scale)
    figure.suptitle(
        style.heading(solution), fontweight="bold", x=0.02, y=1 - 0.1 / tall, ha="left", va="top"
    )
    handles, labels = axes[0].get_legend_handles_labels()
    if any(_ellipses(posture, solution) for _, posture in panels):
        handles.append(Line2D([], [], color=style.INK, linewidth=1.4, linestyle="--"))
        labels.append("each arm alone, at its tip")
    figure.legend(handles, labels, loc="lower center", ncols=columns, frameon=False)
    figure.tight_layout(rect=(0, (below - 0.1) / tall, 1, 1 - 0.3 / tall))
    return figure


def _title(name: str, posture: Posture, solution: Solution) -> str:
    record = posture.ellipsoid
    if record.log_volume is None:
        if name == "nearest miss":
            gap = max(posture.closure_error.values())
            unit = "m or rad" if SPACES[solution.problem.space].rigid else "m"
            return f"{name}: gap {gap:.3g} {unit}"
        return f"{name}: {style.measure_word(solution.problem.space)} 0"
    text = f"{name}: log-volume {record.log_volume:.3f}"
    linear = _linear(record, solution)
    if linear is not None:
        text += f"\nsemi-axes {style.numbers(tuple(linear.radii))} {style.LINEAR_UNIT}"
    space = SPACES[solution.problem.space]
    if space.angular and record.value is not None:
        turn = record.value.sliced(space.angular)
        text += f"\nturning {style.numbers(tuple(turn.radii))} {style.ANGULAR_UNIT}"
    return text


def _linear(record: EllipsoidRecord, solution: Solution) -> Ellipsoid | None:
    """The slice that can be drawn in the plane: no angular acceleration."""
    ellipsoid = record.value
    return None if ellipsoid is None else ellipsoid.sliced(SPACES[solution.problem.space].linear)


def _ellipses(posture: Posture, solution: Solution) -> list[Ellipsoid]:
    records = [posture.ellipsoid, *(arm.ellipsoid for arm in posture.arms.values())]
    slices = [_linear(record, solution) for record in records]
    return [ellipse for ellipse in slices if ellipse is not None]


def _scene(ax: Axes, posture: Posture, solution: Solution, scale: float) -> None:
    ax.grid(True, color="#EEEEEE", linewidth=0.8)
    ax.set_axisbelow(True)
    center = np.array(posture.object.position)
    outline = _outline(posture, solution)
    if outline is not None:
        ax.add_patch(
            Polygon(outline, facecolor=style.OBJECT, edgecolor=style.INK, linewidth=1, zorder=2)
        )
    colors = dict(zip(posture.arms, style.ARMS * len(posture.arms), strict=False))
    for name, arm in posture.arms.items():
        points = np.array(arm.skeleton)[:, :2]
        color = colors[name]
        ax.plot(*points.T, color=color, linewidth=5, solid_capstyle="round",
                solid_joinstyle="round", alpha=0.85, zorder=3,
                label=f"arm {style.short(name)}")  # fmt: skip
        ax.plot(*points[1:-1].T, linestyle="", marker="o", markersize=7, markerfacecolor="white",
                markeredgecolor=style.INK, markeredgewidth=1.2, zorder=5)  # fmt: skip
        ax.plot(*points[-1], marker="o", markersize=4, color=style.INK, zorder=5)
        ax.plot(*points[0], marker="s", markersize=12, color=color, alpha=0.5, zorder=2)
        if posture.closure_error[name] > style.OPEN:
            gap = np.array([points[-1], arm.grasp[:2]])
            ax.plot(*gap.T, color=style.INK, linewidth=1.2, linestyle=":", zorder=5)
            ax.plot(*gap[1], marker="x", markersize=8, color=style.INK, zorder=6)
            continue
        ellipse = _linear(arm.ellipsoid, solution)
        if ellipse is not None:
            curve = points[-1] + scale * _curve(ellipse)
            ax.plot(*curve.T, color=color, linewidth=1.4, linestyle="--", zorder=4)
    ellipse = _linear(posture.ellipsoid, solution)
    ax.add_patch(Circle(tuple(center), 0.008, color=style.INK, zorder=6))
    if ellipse is not None:
        curve = center + scale * _curve(ellipse)
        ax.fill(*curve.T, color=style.SYSTEM, alpha=0.25, zorder=4)
        ax.plot(
            *curve.T, color=style.SYSTEM, linewidth=2.2, zorder=6, label="together, at the object"
        )


def _curve(ellipse: Ellipsoid) -> Array:
    angle = np.linspace(0, 2 * np.pi, 181)
    return ellipse.boundary(np.column_stack([np.cos(angle), np.sin(angle)]))


def _outline(posture: Posture, solution: Solution) -> Array | None:
    shape = solution.problem.shape
    center = np.array(posture.object.position)
    if shape is None:
        return None
    if shape.kind == "disk":
        angle = np.linspace(0, 2 * np.pi, 90)
        return np.asarray(center + shape.radius * np.column_stack([np.cos(angle), np.sin(angle)]))
    half = np.array(shape.size[:2]) / 2  # type: ignore[union-attr]
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    turn = posture.object.angle  # type: ignore[union-attr]
    c, s = np.cos(turn), np.sin(turn)
    return np.asarray(center + corners @ np.array([[c, s], [-s, c]]))


def _extent(solution: Solution, postures: list[Posture]) -> tuple[Array, Array]:
    points = [np.array([*a.skeleton, a.grasp])[:, :2] for p in postures for a in p.arms.values()]
    points += [o for p in postures if (o := _outline(p, solution)) is not None]
    points += [np.array([p.object.position]) for p in postures]
    stacked = np.vstack(points)
    return stacked.min(axis=0), stacked.max(axis=0)


def _grown(
    low: Array, high: Array, posture: Posture, solution: Solution, scale: float
) -> tuple[Array, Array]:
    """The extent with the posture's ellipses in it."""
    placed: list[tuple[tuple[float, ...], EllipsoidRecord]]
    placed = [(posture.object.position, posture.ellipsoid)]
    placed += [(arm.skeleton[-1][:2], arm.ellipsoid) for arm in posture.arms.values()]
    for center, record in placed:
        ellipse = _linear(record, solution)
        if ellipse is not None:
            curve = np.array(center) + scale * _curve(ellipse)
            low, high = np.minimum(low, curve.min(axis=0)), np.maximum(high, curve.max(axis=0))
    return low, high


def _scale_bar(ax: Axes, low: Array, high: Array, scale: float) -> None:
    """How long an acceleration per torque is drawn, below the scene's right corner."""
    value = style.round_scale(0.3 * float(high[0] - low[0]) / scale)
    down = ScaledTranslation(0, -38 / 72, ax.get_figure().dpi_scale_trans)  # type: ignore[union-attr]
    below = ax.get_xaxis_transform() + down
    ends = np.array([high[0] - value * scale, high[0]])
    ax.plot(ends, [0, 0], transform=below, color=style.INK, linewidth=2.5, clip_on=False)
    ax.annotate(
        f"{value:g} {style.LINEAR_UNIT}", (high[0], 0), xycoords=below, xytext=(0, -5),
        textcoords="offset points", ha="right", va="top", fontsize=9,
    )  # fmt: skip
