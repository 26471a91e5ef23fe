"""Pictures of planar postures."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.transforms import ScaledTranslation

from copose.poses import Array
from copose.report import style
from copose.report.charts import legends
from copose.report.charts.exact_sets import draw_set, set_pictures
from copose.report.charts.torque_shares import draw_shares, share_panels
from copose.report.figures.titles import title
from copose.report.geometry.free_ranges import ranges
from copose.report.geometry.slices import angular_slice, linear_slice
from copose.report.scene.forces import holding_arrows
from copose.report.scene.planar import Stage
from copose.report.style import Panel

# Width of a panel, inches.
_PANEL = 4.6
# Height of what stands below the scenes, inches.
_BENEATH = 2.6


def planar_figure(panels: list[Panel], heading: str) -> Figure:
    """Postures side by side at one scale, with every arm's own ellipse and the system's."""
    solution = panels[0].solution
    stage = Stage.of(panels)
    sets, holding = set_pictures(panels), share_panels(panels)
    arrows, words = holding_arrows(panels[0].posture, stage.size) if sets else ([], "")
    low, high = stage.frame(panels, [tail for tail, _ in arrows])
    width, height = high - low
    wide = _PANEL * (len(panels) + bool(sets)) + 0.6
    keys = legends.keys(solution.joint_names, legends.TOGETHER, legends.ALONE)
    keys += [legends.RANGES] * any(map(ranges, panels))
    columns, rows = legends.legend_grid(keys, wide)
    titles = [_title(panel) for panel in panels]
    more = max(0, *(words.count("\n") - 2 for words in titles))
    above = 1.0 + 0.24 * more
    below = 0.3 + 0.27 * rows
    beneath = _BENEATH if holding or len(sets) > 1 else 0.0
    tall = min(_PANEL * height / width + above, 7.5) + below + beneath
    if sets:
        tall = max(tall, _PANEL + 0.6 + below + beneath)
    figure = Figure(figsize=(wide, tall))
    axes = figure.subplots(1, len(panels), squeeze=False, sharex=True, sharey=True)[0]
    for k, ax in enumerate(axes):
        stage.draw(ax, panels, k, low, high)
        if sets:
            _forces(ax, arrows, words)
            ax.set_anchor("N")
        ax.set_title(titles[k], loc="left")
        ax.set_xlabel("x, m")
    axes[0].set_ylabel("y, m")
    for ax, panel, scale in zip(axes, panels, stage.scales or [], strict=False):
        unit = style.units(panel.solution)[0]
        if panel is panels[-1] or unit != style.units(panels[-1].solution)[0]:
            scale_bar(ax, low, high, scale, unit)
    figure.suptitle(heading, fontweight="bold", x=0.02, y=1 - 0.1 / tall, ha="left", va="top")
    handles, labels = axes[0].get_legend_handles_labels()
    if stage.scales:
        handles.append(Line2D([], [], color=style.INK, linewidth=1.4, linestyle="--"))
        labels.append(legends.ALONE)
    if any(panel.other is not None for panel in panels):
        handles.append(Line2D([], [], color=style.INK, linewidth=1.4, linestyle=":"))
        labels.append("the other one's")
    figure.legend(handles, labels, loc="lower center", ncols=columns, frameon=False)
    scenes = len(panels) / (len(panels) + bool(sets))
    figure.tight_layout(
        rect=(0, (below - 0.1 + beneath) / tall, scenes, 1 - (0.3 + 0.05 * more) / tall)
    )
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
    words, *more = title(panel).split("\n")
    lines = [words]
    parts = linear_slice, angular_slice
    for word, part, unit in zip(
        ("semi-axes", "turning"), parts, style.units(panel.solution), strict=True
    ):
        found = part(panel.posture.ellipsoid, panel.solution.problem.axes)
        if found is not None and panel.name != style.MISS:
            lines.append(f"{word} {style.numbers(tuple(found.ellipsoid.radii))} {unit}")
    return "\n".join([*lines, *more])


def _forces(ax: Axes, arrows: list[tuple[Array, Array]], words: str) -> None:
    """Arrows from tail to head, and what they are."""
    for tail, head in arrows:
        ax.annotate("", tuple(head), tuple(tail), zorder=7,
                    arrowprops={"arrowstyle": "-|>", "color": style.INK, "linewidth": 1.8,
                                "shrinkA": 0, "shrinkB": 0, "mutation_scale": 14})  # fmt: skip
    if arrows:
        ax.plot([], [], color=style.INK, linewidth=1.8, label=words)


def scale_bar(ax: Axes, low: Array, high: Array, scale: float, unit: str) -> None:
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
