"""Pictures of planar postures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.transforms import ScaledTranslation

from copose.poses import Array
from copose.report.charts.exact_sets import (
    SetPicture,
    draw_set,
    draw_shares,
    set_pictures,
    share_panels,
)
from copose.report.charts.legends import Entry, legend_entries, legend_grid
from copose.report.geometry.shapes import ranges
from copose.report.geometry.slices import angular_slice, linear_slice
from copose.report.look import LOOK
from copose.report.panels import Panel, title
from copose.report.scene.planar import PlanarStage, draw_arrows, holding_arrows
from copose.report.words import round_scale, semi_axis_units


@dataclass(frozen=True)
class PlanarLook:
    """Sizes of a planar picture, inches."""

    panel: float = 4.6  # width of a panel
    charts: float = 2.6  # height of the row of charts below the scenes
    tallest: float = 7.5  # scenes with their titles
    left: float = 0.75  # numbers and words left of the scenes
    right: float = 0.16  # margin right of them
    under: float = 0.21  # their numbers and words below, beyond those of the legend
    head: float = 0.6  # heading of the whole, and what is free below it
    line: float = 0.19  # height of a line of a title
    between: float = 0.05  # free between two scenes, of their width


@dataclass(frozen=True)
class _PlanarLayout:
    """Sizes of one planar picture, inches."""

    wide: float  # width of the whole
    tall: float  # height of the whole
    below: float  # height of the legend
    charts: float  # height of the row of charts between scenes and legend, 0 without
    scenes: float  # width of the scenes as a share of the whole; an exact set stands beside them


def planar_figure(panels: list[Panel], heading: str) -> Figure:
    """Postures side by side at one scale, with every arm's own ellipse and the system's."""
    stage = PlanarStage.of(panels)
    sets, holding = set_pictures(panels), share_panels(panels)
    arrows, words = holding_arrows(panels[0].posture, stage.size) if sets else ([], "")
    low, high = stage.frame(panels, [tail for tail, _ in arrows])
    wide = PlanarLook.panel * (len(panels) + bool(sets)) + 0.6
    entries = legend_entries(panels[0].solution.joint_names, Entry.TOGETHER, Entry.ALONE)
    entries += [Entry.RANGES] * any(map(ranges, panels))
    columns, rows = legend_grid(entries, wide)
    titles = [_title(panel) for panel in panels]
    lines = 1 + max(title.count("\n") for title in titles)
    below = 0.3 + 0.27 * rows
    charts = PlanarLook.charts if holding or len(sets) > 1 else 0.0
    width, height = high - low
    tall = PlanarLook.panel * height / width + 1.0 + 0.24 * max(0, lines - 3)
    tall = min(tall, PlanarLook.tallest) + below + charts
    if sets:
        tall = max(tall, PlanarLook.panel + 0.6 + below + charts)
    layout = _PlanarLayout(wide, tall, below, charts, len(panels) / (len(panels) + bool(sets)))
    figure = Figure(figsize=(wide, tall))
    axes = figure.subplots(1, len(panels), squeeze=False, sharex=True, sharey=True)[0]
    for k, ax in enumerate(axes):
        stage.draw(ax, panels, k, low, high)
        if sets:
            draw_arrows(ax, arrows, words)
            ax.set_anchor("N")
        ax.set_title(titles[k], loc="left")
        ax.set_xlabel("x, m")
    axes[0].set_ylabel("y, m")
    for ax, panel, scale in zip(axes, panels, stage.scales or [], strict=False):
        unit = semi_axis_units(panel.solution)[0]
        if panel is panels[-1] or unit != semi_axis_units(panels[-1].solution)[0]:
            scale_bar(ax, low, high, scale, unit)
    figure.suptitle(heading, fontweight="bold", x=0.02, y=1 - 0.1 / tall, ha="left", va="top")
    _draw_legend(figure, panels, columns, scaled=bool(stage.scales))
    figure.subplots_adjust(
        left=PlanarLook.left / wide, right=layout.scenes - PlanarLook.right / wide,
        wspace=PlanarLook.between, bottom=(below + charts + PlanarLook.under) / tall,
        top=1 - (PlanarLook.head + PlanarLook.line * lines) / tall,
    )  # fmt: skip
    _draw_charts(figure, layout, sets, holding, named=len(panels) > 1)
    return figure


def _title(panel: Panel) -> str:
    """A panel's title, with the semi-axes of its ellipse and its fastest turn."""
    first, *following = title(panel).split("\n")
    lines = [first]
    parts = linear_slice, angular_slice
    for word, part, unit in zip(
        ("semi-axes", "turning"), parts, semi_axis_units(panel.solution), strict=True
    ):
        drawn = part(panel.posture.ellipsoid, panel.solution.problem.axes)
        if drawn is not None and not panel.misses:
            radii = ", ".join(f"{radius:.3g}" for radius in drawn.ellipsoid.radii)
            lines.append(f"{word} {radii} {unit}")
    return "\n".join([*lines, *following])


def _draw_legend(figure: Figure, panels: list[Panel], columns: int, *, scaled: bool) -> None:
    """The legend below all else; ``scaled`` where ellipses are drawn."""
    handles, labels = figure.axes[0].get_legend_handles_labels()
    if scaled:
        handles.append(Line2D([], [], color=LOOK.ink, linewidth=1.4, linestyle="--"))
        labels.append(Entry.ALONE)
    if any(panel.other is not None for panel in panels):
        handles.append(Line2D([], [], color=LOOK.ink, linewidth=1.4, linestyle=":"))
        labels.append("the other one's")
    figure.legend(handles, labels, loc="lower center", ncols=columns, frameon=False)


def _draw_charts(
    figure: Figure,
    layout: _PlanarLayout,
    sets: list[SetPicture],
    holding: list[Panel],
    *,
    named: bool,
) -> None:
    """The first exact set beside the scenes, and below them the others and shares of torques."""
    wide, tall, left = layout.wide, layout.tall, 0.6 / layout.wide
    top, right = layout.below + layout.charts, 1 - 0.2 / wide
    if sets:
        side = figure.add_gridspec(1, 1, left=layout.scenes + left, right=right,
                                   bottom=(top + 0.5) / tall, top=1 - 1.0 / tall)  # fmt: skip
        draw_set(figure, side[0, 0], sets[0], columns=2)
    if layout.charts:
        row = figure.add_gridspec(1, len(sets[1:]) + bool(holding), left=left, right=right,
                                  bottom=(layout.below + 0.5) / tall,
                                  top=(top - 0.8) / tall)  # fmt: skip
        for k, exact in enumerate(sets[1:]):
            draw_set(figure, row[0, k], exact, columns=0)
        if holding:
            draw_shares(figure.add_subplot(row[0, -1]), holding, named=named)


def scale_bar(ax: Axes, low: Array, high: Array, scale: float, unit: str) -> None:
    """A bar for the length at which an acceleration is drawn, below the scene's right corner."""
    value = round_scale(0.3 * float(high[0] - low[0]) / scale)
    down = ScaledTranslation(0, -38 / 72, ax.get_figure().dpi_scale_trans)  # type: ignore[union-attr]
    below = ax.get_xaxis_transform() + down
    ends = np.array([high[0] - value * scale, high[0]])
    ax.plot(ends, [0, 0], transform=below, color=LOOK.ink, linewidth=2.5, clip_on=False)
    ax.annotate(
        f"{value:g} {unit}", (high[0], 0), xycoords=below, xytext=(0, -5),
        textcoords="offset points", ha="right", va="top", fontsize=9,
    )  # fmt: skip
