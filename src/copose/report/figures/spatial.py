"""Pictures of spatial postures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from copose.report.charts.exact_sets import (
    SetPicture,
    draw_set,
    draw_shares,
    set_pictures,
    share_panels,
)
from copose.report.charts.legends import Entry, legend_below, legend_entries, legend_grid
from copose.report.geometry.shapes import ranges
from copose.report.look import LOOK
from copose.report.panels import Panel, moved_words, title
from copose.report.scene.planar import draw_arrows, holding_arrows
from copose.report.scene.spatial import SliceKind, SpatialStage
from copose.report.words import short


@dataclass(frozen=True)
class _SpatialLayout:
    """The places of one spatial picture in its figure."""

    scenes: list[Any]  # a place for each panel, and one for each exact set
    # A place for the semi-axes of each kind of slices, and one for shares of torques.
    bars: list[Any]
    legends_below: bool  # whether legends stand below scenes, and not within them
    columns: int  # columns of such a legend

    @classmethod
    def of(
        cls, figure: Figure, panels: list[Panel], kinds: int, sets: int, lines: int, *, shares: bool
    ) -> _SpatialLayout:
        """The layout of panels in a figure, whose height it sets, by the numbers of kinds of
        slices, of exact sets, and of lines of words between heading and scenes, and with shares of
        torques or without.
        """
        # Shares stand beside the semi-axes where exact sets make the picture wide, else below them.
        apart = shares and not (sets and kinds)
        rows = [3.6] + [1.0] * bool(kinds) + [1.0] * apart
        count = len(panels) + sets
        # Titles of more than a line leave a legend no room beside them.
        legends_below = bool(sets) or any(ranges(p) or "\n" in title(p) for p in panels)
        tall = 4.2 + 2.0 * len(rows) + 0.6 * bool(sets or apart)
        figure.set_size_inches(5.5 * max(count, 2), tall)
        entries = legend_entries(panels[0].posture.arms, Entry.RANGES)
        entries += [Entry.OTHER] * any(panel.other is not None for panel in panels)
        columns, legend_rows = (2, 1) if sets else legend_grid(entries, 6.4)
        # Legends and words of bars stand under what the grid places.
        low = legends_below and len(rows) == 1 and not sets
        bottom = 0.14 if low else 0.08 if shares else 0.06
        gap = 0.3 if sets or apart else 0.16
        if legends_below and not sets:
            gap = 0.22 + 0.08 * legend_rows
        grid = figure.add_gridspec(
            len(rows), 2 * len(panels), height_ratios=rows, left=0.03, right=0.94, bottom=bottom,
            top=0.9 - 0.024 * max(0, lines - 1), hspace=gap, wspace=0.3,
        )  # fmt: skip
        scenes = [grid[0, 2 * k : 2 * k + 2] for k in range(len(panels))]
        if sets:
            top = grid[0, :].subgridspec(1, count, wspace=0.2)
            scenes = [top[0, k] for k in range(count)]
        span = 2 * len(panels) // max(kinds, 1)
        bars = [grid[1, span * k : span * (k + 1)] for k in range(kinds)]
        if apart:
            bars.append(grid[-1, :])
        elif shares:
            parts = [1] * kinds + [2]
            below = grid[1, :].subgridspec(1, len(parts), width_ratios=parts, wspace=0.16)
            bars = [below[0, k] for k in range(len(parts))]
        return cls(scenes, bars, legends_below, columns)


def spatial_figure(panels: list[Panel], heading: str) -> Figure:
    """Scenes with the ellipsoid's linear and angular slices, and their semi-axes as bars.

    Beside them stands what torque limits allow, where results say so: exact sets and shares.
    """
    stage, sets, holding = SpatialStage.of(panels), set_pictures(panels), share_panels(panels)
    kinds = stage.kinds
    alone = len({id(panel.solution) for panel in panels}) == 1
    moved = moved_words(panels[0].solution) if alone else ""
    lines = [(kind.words(panels), kind.color) for kind in kinds]
    lines += [(moved, LOOK.ink)] if moved else []
    figure = Figure()
    layout = _SpatialLayout.of(
        figure, panels, len(kinds), len(sets), len(lines), shares=bool(holding)
    )
    for k in range(len(panels)):
        _draw_panel(figure, layout, stage, panels, k, sets)
    for exact, place in zip(sets, layout.scenes[len(panels) :], strict=True):
        draw_set(figure, place, exact, columns=3)
    for kind, place in zip(kinds, layout.bars, strict=False):
        _draw_bars(figure.add_subplot(place), panels, kind)
    if holding:
        draw_shares(figure.add_subplot(layout.bars[-1]), holding, named=len(panels) > 1)
    figure.suptitle(heading, fontweight="bold", x=0.02, y=0.985, ha="left")
    for k, (words, color) in enumerate(lines):
        figure.text(0.02, 0.935 - 0.024 * k, words, fontsize=9.5, color=color)
    return figure


def _draw_panel(
    figure: Figure, layout: _SpatialLayout, stage: SpatialStage, panels: list[Panel], k: int,
    sets: list[SetPicture],
) -> None:  # fmt: skip
    """The scene of one of the panels with its legend and title."""
    ax: Any = figure.add_subplot(layout.scenes[k], projection="3d")
    stage.draw(ax, panels, k, whole=layout.legends_below and not sets)
    if sets:
        size = float((stage.high - stage.low).max())
        draw_arrows(ax, *holding_arrows(panels[k].posture, size))
    handles, labels = ax.get_legend_handles_labels()
    if layout.legends_below:
        legend_below(ax, handles, labels, columns=layout.columns, points=8)
    else:
        ax.legend(loc="upper right", frameon=False, fontsize=9)
    words = title(panels[k])
    highest = 0.96 if layout.legends_below else 0.99
    ax.set_title(words, loc="left", y=highest - 0.05 * words.count("\n"),
                 fontsize=9.5 if "\n" in words else 11)  # fmt: skip


def _draw_bars(ax: Axes, panels: list[Panel], kind: SliceKind) -> None:
    """The semi-axes of the slices of all panels."""
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
            color=LOOK.before if k + 1 < len(panels) else kind.color,
            label=short(panel.name) + (f", {kind.unit(panel)}" if len(units) > 1 else ""),
        )  # fmt: skip
        ax.bar_label(drawn, [f"{radius:.3g}" for radius in radii], fontsize=9, padding=1)
    words = {1: [""], 2: ["longest", "shortest"], 3: ["longest", "middle", "shortest"]}
    ax.set_xticks(np.arange(count), words[count])
    ax.margins(y=0.15)
    ax.set_yticks([])
    ax.spines[["top", "right", "left"]].set_visible(False)
    title = f"semi-axes of the {kind.name} slice" + (f", {units[0]}" if len(units) == 1 else "")
    ax.set_title(title, fontsize=10, color=kind.color, loc="left", pad=20)
    if len(panels) > 1:
        ax.legend(frameon=False, fontsize=9, loc="lower left", bbox_to_anchor=(0, 0.98),
                  ncols=len(panels), borderaxespad=0.1)  # fmt: skip
