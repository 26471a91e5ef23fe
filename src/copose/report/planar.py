"""Pictures of planar postures."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon
from matplotlib.transforms import ScaledTranslation

from copose.poses import Array
from copose.problem import SPACES
from copose.report import style
from copose.report.exact_sets import draw_set, set_pictures
from copose.report.forces import holding_arrows
from copose.report.shares import draw_shares, share_panels
from copose.report.slices import Slice, all_coordinates, angular_slice, linear_slice
from copose.report.style import Panel
from copose.results import Posture, Solution

# The longest semi-axis drawn, as a share of the scene's larger side.
_ELLIPSE_SHARE = 0.3
# Width of a panel, inches.
_PANEL = 4.6
# Height of what stands below the scenes, inches.
_BENEATH = 2.6


def planar_figure(panels: list[Panel], heading: str) -> Figure:
    """Postures side by side at one scale, with every arm's own ellipse and the system's."""
    solution = panels[0].solution
    low, high = _extent(panels)
    size = float((high - low).max())
    placed = [_placed(panel) for panel in panels]
    longest = [max((float(p.ellipsoid.radii[0]) for _, p, _ in ps), default=0.0) for ps in placed]
    found = style.scales(panels, longest, _ELLIPSE_SHARE * size)
    scales = found or [1.0] * len(panels)
    for scale, parts in zip(scales, placed, strict=True):
        for center, part, _ in parts:
            curve = center + scale * part.surface[..., :2]
            low, high = np.minimum(low, curve.min(axis=0)), np.maximum(high, curve.max(axis=0))
    sets, holding = set_pictures(panels), share_panels(panels)
    arrows, words = holding_arrows(panels[0].posture, size) if sets else ([], "")
    for tail, _ in arrows:
        low, high = np.minimum(low, tail), np.maximum(high, tail)
    # A flat scene still needs a frame to be read in.
    least = 0.4 * float((high - low).max())
    margin = 0.04 * size + np.maximum(least - (high - low), 0.0) / 2
    low, high = low - margin, high + margin

    width, height = high - low
    wide = _PANEL * (len(panels) + bool(sets)) + 0.6
    keys = style.keys(solution.joint_names, "together, at the object", "each arm alone, at its tip")
    columns, rows = style.legend_grid(keys, wide)
    above, below = 1.0, 0.3 + 0.27 * rows
    beneath = _BENEATH if holding or len(sets) > 1 else 0.0
    tall = min(_PANEL * height / width + above, 7.5) + below + beneath
    if sets:
        tall = max(tall, _PANEL + 0.6 + below + beneath)
    figure = Figure(figsize=(wide, tall))
    axes = figure.subplots(1, len(panels), squeeze=False, sharex=True, sharey=True)[0]
    for ax, panel, parts, scale in zip(axes, panels, placed, scales, strict=True):
        _scene(ax, panel.posture, panel.solution)
        _ellipses(ax, panel, parts, scale)
        if sets:
            _forces(ax, arrows, words)
            ax.set_anchor("N")
        ax.set_title(_title(panel), loc="left")
        ax.set_xlim(low[0], high[0])
        ax.set_ylim(low[1], high[1])
        ax.set_aspect("equal")
        ax.set_xlabel("x, m")
    axes[0].set_ylabel("y, m")
    for ax, panel, scale in zip(axes, panels, scales, strict=True):
        unit = style.units(panel.solution)[0]
        if found and (panel is panels[-1] or unit != style.units(panels[-1].solution)[0]):
            _scale_bar(ax, low, high, scale, unit)
    figure.suptitle(heading, fontweight="bold", x=0.02, y=1 - 0.1 / tall, ha="left", va="top")
    handles, labels = axes[0].get_legend_handles_labels()
    if found:
        handles.append(Line2D([], [], color=style.INK, linewidth=1.4, linestyle="--"))
        labels.append("each arm alone, at its tip")
    if any(panel.other is not None for panel in panels):
        handles.append(Line2D([], [], color=style.INK, linewidth=1.4, linestyle=":"))
        labels.append("the other one's")
    figure.legend(handles, labels, loc="lower center", ncols=columns, frameon=False)
    scenes = len(panels) / (len(panels) + bool(sets))
    figure.tight_layout(rect=(0, (below - 0.1 + beneath) / tall, scenes, 1 - 0.3 / tall))
    # What has places of its own comes after what is laid out by its size.
    right = 1 - 0.2 / wide
    if sets:
        side = figure.add_gridspec(
            1, 1, left=scenes + 0.6 / wide, right=right, bottom=(below + beneath + 0.5) / tall,
            top=1 - 1.0 / tall,
        )  # fmt: skip
        draw_set(figure, side[0, 0], sets[0], columns=2)
    if beneath:
        row = figure.add_gridspec(
            1, len(sets[1:]) + bool(holding), left=0.6 / wide, right=right,
            bottom=(below + 0.5) / tall, top=(below + beneath - 0.8) / tall,
        )  # fmt: skip
        for k, each in enumerate(sets[1:]):
            draw_set(figure, row[0, k], each, columns=0)
        if holding:
            draw_shares(figure.add_subplot(row[0, -1]), holding, named=len(panels) > 1)
    return figure


def _title(panel: Panel) -> str:
    name, posture, solution = panel.name, panel.posture, panel.solution
    if name == style.MISS:
        gap = max(posture.closure_error.values())
        unit = "m or rad" if SPACES[solution.problem.space].rigid else "m"
        return f"{name}: gap {gap:.3g} {unit}"
    text = f"{name}: {style.value_words(solution, posture)}"
    parts = linear_slice, angular_slice
    for word, part, unit in zip(
        ("semi-axes", "turning"), parts, style.units(solution), strict=True
    ):
        found = part(posture.ellipsoid, solution.problem.axes)
        if found is not None:
            text += f"\n{word} {style.numbers(tuple(found.ellipsoid.radii))} {unit}"
    return text


def _placed(panel: Panel) -> list[tuple[Array, Slice, str | None]]:
    """Centre, slice and arm of the ellipses of a posture; the system's has no arm."""
    posture, solution = panel.posture, panel.solution
    found: list[tuple[Array, Slice, str | None]] = []
    for name, arm in posture.arms.items():
        own = linear_slice(arm.ellipsoid, all_coordinates(solution))
        if own is not None and posture.closure_error[name] <= style.OPEN:
            found.append((np.array(arm.skeleton[-1][:2]), own, name))
    whole = linear_slice(posture.ellipsoid, solution.problem.axes)
    if whole is not None:
        found.append((np.array(posture.object.position), whole, None))
    return found


def _scene(ax: Axes, posture: Posture, solution: Solution) -> None:
    ax.grid(True, color="#EEEEEE", linewidth=0.8)
    ax.set_axisbelow(True)
    center = np.array(posture.object.position)
    outline = _outline(posture, solution)
    if outline is not None:
        ax.add_patch(
            Polygon(outline, facecolor=style.OBJECT, edgecolor=style.INK, linewidth=1, zorder=2)
        )
    for name, color in style.arm_colors(posture).items():
        arm = posture.arms[name]
        points = np.array(arm.skeleton)[:, :2]
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
    ax.add_patch(Circle(tuple(center), 0.008, color=style.INK, zorder=6))


def _ellipses(
    ax: Axes, panel: Panel, parts: list[tuple[Array, Slice, str | None]], scale: float
) -> None:
    colors = style.arm_colors(panel.posture)
    if panel.other is not None:
        axes = panel.other.solution.problem.axes
        other = linear_slice(panel.other.posture.ellipsoid, axes)
        if other is not None:
            curve = np.array(panel.posture.object.position) + scale * other.surface[..., :2]
            ax.plot(*curve.T, color=style.INK, linewidth=1.4, linestyle=":", zorder=6)
    for center, part, name in parts:
        curve = center + scale * part.surface[..., :2]
        if name is not None:
            ax.plot(*curve.T, color=colors[name], linewidth=1.4, linestyle="--", zorder=4)
            continue
        ax.fill(*curve.T, color=style.SYSTEM, alpha=0.25, zorder=4)
        ax.plot(
            *curve.T, color=style.SYSTEM, linewidth=2.2, zorder=6, label="together, at the object"
        )


def _forces(ax: Axes, arrows: list[tuple[Array, Array]], words: str) -> None:
    """Arrows from tail to head, and what they are."""
    for tail, head in arrows:
        ax.annotate("", tuple(head), tuple(tail), zorder=7,
                    arrowprops={"arrowstyle": "-|>", "color": style.INK, "linewidth": 1.8,
                                "shrinkA": 0, "shrinkB": 0, "mutation_scale": 14})  # fmt: skip
    if arrows:
        ax.plot([], [], color=style.INK, linewidth=1.8, label=words)


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


def _extent(panels: list[Panel]) -> tuple[Array, Array]:
    solution, postures = panels[0].solution, [panel.posture for panel in panels]
    points = [np.array([*a.skeleton, a.grasp])[:, :2] for p in postures for a in p.arms.values()]
    points += [o for p in postures if (o := _outline(p, solution)) is not None]
    points += [np.array([p.object.position]) for p in postures]
    stacked = np.vstack(points)
    return stacked.min(axis=0), stacked.max(axis=0)


def _scale_bar(ax: Axes, low: Array, high: Array, scale: float, unit: str) -> None:
    """How long an acceleration per torque is drawn, below the scene's right corner."""
    value = style.round_scale(0.3 * float(high[0] - low[0]) / scale)
    down = ScaledTranslation(0, -38 / 72, ax.get_figure().dpi_scale_trans)  # type: ignore[union-attr]
    below = ax.get_xaxis_transform() + down
    ends = np.array([high[0] - value * scale, high[0]])
    ax.plot(ends, [0, 0], transform=below, color=style.INK, linewidth=2.5, clip_on=False)
    ax.annotate(
        f"{value:g} {unit}", (high[0], 0), xycoords=below, xytext=(0, -5),
        textcoords="offset points", ha="right", va="top", fontsize=9,
    )  # fmt: skip
