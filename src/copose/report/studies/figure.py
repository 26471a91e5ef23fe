"""The picture of a study: which charts it has."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from copose.report.studies.charts.curve import draw_curve, draw_rows
from copose.report.studies.charts.endings import ending_patches
from copose.report.studies.charts.heat_map import (
    HeatLook,
    ValueScale,
    chosen_layers,
    draw_best,
    draw_color_bar,
    draw_dots,
    draw_heat,
    label_keys,
)
from copose.report.studies.charts.key_scales import broken
from copose.report.studies.charts.pair_plot import (
    draw_importance,
    draw_pair,
    draw_parallel,
    most_important,
)
from copose.report.studies.frame import StudyFrame, StudyLook, stars
from copose.report.studies.key_axes import in_lines
from copose.report.studies.map_content import MapContent
from copose.studies.table import StudyTable


def study_figure(table: StudyTable) -> Figure:
    """The map of a study as its file asks for it."""
    content, look = MapContent.of(table), StudyLook()
    keys = len(content.axes)
    if keys == 1:
        return _curve_figure(content, look)
    if keys == 2:
        return _map_figure(content, look)
    if keys == 3 and not content.sampled:
        return _slices_figure(content, look)
    return _pairs_figure(content, look)


def _curve_figure(content: MapContent, look: StudyLook) -> Figure:
    labels = content.axes[0].labels
    rows = look.row * (4 + len(labels or ()))
    tall = look.tall if labels is None else max(look.least, min(look.most, rows))
    frame = StudyFrame.of(content, look, look.wide, tall)
    ax = frame.charts.subplots()
    draw_curve(ax, content) if labels is None else draw_rows(ax, content)
    return frame.finished(ax.get_legend_handles_labels()[0])


def _map_figure(content: MapContent, look: StudyLook) -> Figure:
    frame = StudyFrame.of(content, look, look.wide, look.tall)
    ax, scale = frame.charts.subplots(), ValueScale.of(content.places.values)
    lines, handles = None, list[Any]()
    if content.sampled:
        draw_dots(ax, content, scale)
        handles = [h for h in ax.get_lines() if not str(h.get_label()).startswith("_")]
        if len(content.places) > HeatLook().dots:
            handles = [Patch(color=HeatLook().unsolved, label="no point is solved")]
    else:
        lines, handles = draw_heat(ax, content, scale), ending_patches(content)
    draw_best(ax, content)
    label_keys(ax, content)
    draw_color_bar(frame.charts, ax, content, scale, lines, pad=0.02)
    return frame.finished([*stars(ax), *handles])


def _slices_figure(content: MapContent, look: StudyLook) -> Figure:
    layers, scale = chosen_layers(content), ValueScale.of(content.places.values)
    # As few empty places as can be.
    columns = min(len(layers), min((4, 3), key=lambda n: -len(layers) % n))
    rows = -(-len(layers) // columns)
    wide = max(look.wide, look.slice * columns + 1.2)
    frame = StudyFrame.of(content, look, wide, max(4.0, look.slice * rows))
    charts = frame.charts.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    handles: list[Any] = []
    for k, ax in enumerate(charts.flat):
        if k >= len(layers):
            ax.set_visible(False)
            continue
        _draw_slice(ax, content, scale, layers[k])
        handles += stars(ax)
        _label_outer(ax, content, x=k + columns >= len(layers), y=k % columns == 0)
    draw_color_bar(frame.charts, list(charts.flat), content, scale, pad=0.02)
    return frame.finished([*handles, *ending_patches(content)])


def _draw_slice(ax: Axes, content: MapContent, scale: ValueScale, layer: int) -> None:
    """A slice with the value of the third key above it, in bold where the best point is."""
    third, rows = content.axes[2], content.table.study.points.axes[content.axes[2].number].rows
    along = float((rows or ())[layer][0]) if third.labels is None else float(layer)
    draw_heat(ax, content, scale, layer)
    here = content.best is not None and content.where(content.best)[2] == along
    words = f"{third.value(along)} {third.unit}".rstrip()
    name = f"{'.'.join(third.name.split('.')[-2:])} = " if third.labels is None else ""
    ax.set_title(f"{name}{in_lines(words, 34)}", fontsize=10, pad=4,
                 fontweight="bold" if here else "normal")  # fmt: skip
    if here:
        draw_best(ax, content)


def _label_outer(ax: Axes, content: MapContent, *, x: bool, y: bool) -> None:
    """Name the axes of a chart, and tick them with numbers, where it stands at an edge."""
    label_keys(ax, content, which="x" * x + "y" * y, few=4)
    ax.tick_params(labelbottom=x, labelleft=y)


def _pairs_figure(content: MapContent, look: StudyLook) -> Figure:
    shown, scale = most_important(content), ValueScale.of(content.places.values)
    count = len(shown.axes) - 1
    high = look.pair * count
    frame = StudyFrame.of(content, look, look.many, high + look.parallel)
    upper, lower = frame.charts.subfigures(2, 1, height_ratios=[high, look.parallel])
    grid, free = upper.add_gridspec(count, count), count // 2
    pairs = [(row, column) for row in range(count) for column in range(row + 1)]
    charts = [upper.add_subplot(grid[place]) for place in pairs]
    for ax, (row, column) in zip(charts, pairs, strict=True):
        pair = replace(shown, axes=(shown.axes[column], shown.axes[row + 1]))
        draw_pair(ax, pair, scale)
        _label_outer(ax, pair, x=row == count - 1, y=column == 0)
        ax.set(xlabel=broken(ax.get_xlabel(), 22), ylabel=broken(ax.get_ylabel(), 18))
    draw_importance(upper.add_subplot(grid[:free, free:]), content)
    parallel = lower.subplots()
    draw_parallel(parallel, shown, scale)
    draw_color_bar(lower, parallel, content, scale, pad=0.01, shrink=0.85)
    return frame.finished(stars(charts[0]))
