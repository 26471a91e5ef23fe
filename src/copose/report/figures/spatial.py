"""Pictures of spatial postures."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from copose.poses import Array
from copose.report import style
from copose.report.charts import legends
from copose.report.charts.exact_sets import draw_set, set_pictures
from copose.report.charts.torque_shares import draw_shares, share_panels
from copose.report.figures.moves import moved_words
from copose.report.figures.titles import title
from copose.report.geometry.free_ranges import ranges
from copose.report.scene.forces import holding_arrows
from copose.report.scene.spatial import Kind, Stage
from copose.report.style import Panel


def spatial_figure(panels: list[Panel], heading: str) -> Figure:
    """Scenes with the ellipsoid's linear and angular slices, and their semi-axes as bars.

    Beside them what torque limits allow, where the results say so: exact sets and shares.
    """
    stage, sets, holding = Stage.of(panels), set_pictures(panels), share_panels(panels)
    kinds = stage.kinds
    alone = len({id(panel.solution) for panel in panels}) == 1
    moved = moved_words(panels[0].solution) if alone else ""
    # Shares stand beside the semi-axes where exact sets make the picture wide, else below them.
    apart = bool(holding) and not (sets and kinds)
    rows = [3.6] + [1.0] * bool(kinds) + [1.0] * apart
    count = len(panels) + len(sets)
    # Titles of more than a line leave a legend no room beside them.
    legends_below = bool(sets) or any(ranges(p) or "\n" in title(p) for p in panels)
    tall = 4.2 + 2.0 * len(rows) + 0.6 * bool(sets or apart)
    figure = Figure(figsize=(5.5 * max(count, 2), tall))
    keys = legends.keys(panels[0].posture.arms, legends.RANGES)
    keys += [legends.OTHER] * any(panel.other is not None for panel in panels)
    columns, lines = (2, 1) if sets else legends.legend_grid(keys, 6.4)
    # Legends and bars' words stand under what the grid places.
    bottom = 0.14 if legends_below and len(rows) == 1 and not sets else 0.08 if holding else 0.06
    gap = 0.3 if sets or apart else 0.16
    if legends_below and not sets:
        gap = 0.22 + 0.08 * lines
    grid = figure.add_gridspec(
        len(rows), 2 * len(panels), height_ratios=rows, left=0.03, right=0.94, bottom=bottom,
        top=0.9 - 0.024 * max(0, len(kinds) + bool(moved) - 1), hspace=gap, wspace=0.3,
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
    for k, panel in enumerate(panels):
        ax: Any = figure.add_subplot(places[k], projection="3d")
        stage.draw(ax, panels, k, whole=legends_below and not sets)
        if sets:
            _forces(ax, *holding_arrows(panel.posture, float((stage.high - stage.low).max())))
        handles, labels = ax.get_legend_handles_labels()
        if legends_below:
            legends.legend_below(ax, handles, labels, columns=columns, points=8)
        else:
            ax.legend(loc="upper right", frameon=False, fontsize=9)
        words = title(panel)
        highest = 0.96 if legends_below else 0.99
        ax.set_title(words, loc="left", y=highest - 0.05 * words.count("\n"),
                     fontsize=9.5 if "\n" in words else 11)  # fmt: skip
    for each, place in zip(sets, places[len(panels) :], strict=True):
        draw_set(figure, place, each, columns=3)
    for kind, place in zip(kinds, bars, strict=False):
        _bars(figure.add_subplot(place), panels, kind)
    if holding:
        draw_shares(figure.add_subplot(bars[-1]), holding, named=len(panels) > 1)
    figure.suptitle(heading, fontweight="bold", x=0.02, y=0.985, ha="left")
    lines_above = [(kind.words(panels), kind.color) for kind in kinds]
    lines_above += [(moved, style.INK)] if moved else []
    for k, (words, color) in enumerate(lines_above):
        figure.text(0.02, 0.935 - 0.024 * k, words, fontsize=9.5, color=color)
    return figure


def _bars(ax: Axes, panels: list[Panel], kind: Kind) -> None:
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


def _forces(ax: Any, arrows: list[tuple[Array, Array]], words: str) -> None:
    """Arrows from tail to head, and what they are."""
    for tail, head in arrows:
        ax.quiver(*tail, *(head - tail), color=style.INK, linewidth=1.8, arrow_length_ratio=0.3)
    if arrows:
        ax.plot([], [], color=style.INK, linewidth=1.8, label=words)
