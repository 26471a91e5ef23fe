"""The picture of a study: its charts, words above, the trade-off beside, the legend below."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from copose.poses import Array
from copose.report.look import LOOK
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
    PairLook,
    draw_importance,
    draw_pair,
    draw_parallel,
    most_important,
)
from copose.report.studies.key_axes import in_lines, titled, value_words
from copose.report.studies.map_content import MapContent, TradeOff
from copose.report.words import three
from copose.studies.table import StudyTable


@dataclass(frozen=True)
class TradeOffLook:
    """Look of a trade-off."""

    named: int = 5  # points of the front that are named
    dots: int = 20_000  # points that are drawn; of more those that others hide are left out
    raster: int = 150  # cells along each axis in which then one point is drawn
    letters: str = "ABCDEFGH"


def draw_trade_off(ax: Axes, content: MapContent) -> None:
    """Draw the solved points, and the Pareto front as a step line with letters at some."""
    trade = content.trade_off
    if trade is None:
        return
    solved = trade.numbers
    if len(content.places) > TradeOffLook.dots:
        solved = _thinned(solved, TradeOffLook.raster)
    ax.plot(*solved, linestyle="", marker="o", markersize=4, color=LOOK.before, alpha=0.7,
            markeredgecolor="none", rasterized=True, label="solved points")  # fmt: skip
    one, other = trade.numbers[:, trade.front]
    # From one point to the next the second number stays what it is until the first one is met.
    ax.plot(one, other, drawstyle="steps-post", color=LOOK.system, linewidth=2)
    ax.plot(one, other, linestyle="", marker="o", markersize=6, color=LOOK.system,
            label=f"Pareto front ({len(trade.front):,}): no point is better in both")  # fmt: skip
    for letter, place in named_points(trade):
        x, y = trade.numbers[:, place].tolist()
        ax.annotate(letter, (x, y), xytext=(7, 6), textcoords="offset points",
                    fontweight="bold", fontsize=10,
                    bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.8},
                    )  # fmt: skip
    words = [_wanted(trade, k, content) for k in (0, 1)]
    ax.set_xlabel(words[0])
    ax.set_ylabel(words[1])
    ax.grid(True, color=LOOK.grid, linewidth=0.8)
    ax.set_axisbelow(True)
    ax.tick_params(labelsize=9)
    ax.margins(0.07)
    ax.spines[["top", "right"]].set_visible(False)


def _thinned(numbers: Array, raster: int) -> Array:
    """Middles of the cells of a raster that have points in them, (2, count)."""
    lows, highs = np.nanmin(numbers, axis=1), np.nanmax(numbers, axis=1)
    size = np.maximum(highs - lows, 1e-300) / raster
    known = np.isfinite(numbers).all(axis=0)
    cell = np.zeros(int(known.sum()), dtype=np.intp)
    for k in range(2):
        along = ((numbers[k, known] - lows[k]) / size[k]).astype(np.intp)
        cell = cell * raster + np.minimum(along, raster - 1)
    met = np.flatnonzero(np.bincount(cell, minlength=raster**2))
    places = np.array(np.divmod(met, raster), dtype=float)
    middles: Array = lows[:, None] + (places + 0.5) * size[:, None]
    return middles


def _wanted(trade: TradeOff, k: int, content: MapContent) -> str:
    name, unit = value_words(content.table.study, trade.names[k])
    return f"{titled(name, unit)}\n({'more' if trade.signs[k] > 0 else 'less'} is better)"


def named_points(trade: TradeOff) -> list[tuple[str, int]]:
    """A few points of the front, evenly chosen with both its ends, and a letter for each."""
    last = len(trade.front) - 1
    chosen = np.linspace(0, max(last, 0), min(TradeOffLook.named, last + 1)).round().astype(np.intp)
    return list(zip(TradeOffLook.letters, trade.front[chosen].tolist(), strict=False))


def named_told(content: MapContent) -> list[str]:
    """A line for each named point of the front: its keys' values and its two numbers."""
    trade = content.trade_off
    if trade is None:
        return []
    return [
        f"{letter}: {three(float(trade.numbers[0, place]))} and "
        f"{three(float(trade.numbers[1, place]))} at {content.told(place)}"
        for letter, place in named_points(trade)
    ]


@dataclass(frozen=True)
class StudyLook:
    """Sizes of the picture of a study, inches but for the last three."""

    wide: float = 8.6  # width of a map
    tall: float = 5.6  # its height, without words
    beside: float = 6.4  # width of the trade-off beside it
    slice: float = 3.0  # width and height of a slice
    pair: float = 2.3  # height of a row of pairs
    parallel: float = 3.6  # height of parallel coordinates
    many: float = 14.0  # width of charts of many keys
    row: float = 0.3  # height of a row for a name
    least: float = 2.2  # height of rows for names
    most: float = 12.0  # alike
    heading: float = 0.22  # height of a line of the heading
    line: float = 0.19  # of the caption
    entry: float = 0.24  # of the legend
    edge: float = 0.12  # around words
    bold: float = 10.5  # letters of the heading to an inch
    letters: float = 13.0  # of the caption
    grey: str = "#555555"  # colour of the caption


@dataclass(frozen=True)
class StudyFrame:
    """A figure with a place for the map of a study, and for the trade-off beside it."""

    content: MapContent  # the map
    figure: Figure
    charts: Any  # where the map is drawn
    beside: Any  # where the trade-off is drawn; None where there is none
    look: StudyLook  # sizes

    @classmethod
    def of(cls, content: MapContent, look: StudyLook, wide: float, tall: float) -> StudyFrame:
        """A frame around a map of a size, inches."""
        beside = content.trade_off is not None
        figure = Figure(figsize=(wide + look.beside * beside, tall))
        figure.set_layout_engine("constrained")
        if not beside:
            return cls(content, figure, figure, None, look)
        both: Any = figure.subfigures(1, 2, width_ratios=[wide, look.beside], wspace=0.03)
        return cls(content, figure, both[0], both[1], look)

    def finished(self, handles: list[Any]) -> Figure:
        """The figure with words and a legend, the best point first; it grows by their heights."""
        self._draw_trade_off()
        wide, charts = (float(inches) for inches in self.figure.get_size_inches())
        look, content = self.look, self.content
        heading = textwrap.wrap(content.heading(), int(look.bold * wide))
        caption = [line for part in _caption(content)
                   for line in textwrap.wrap(part, int(look.letters * wide))]  # fmt: skip
        ordered = sorted(handles, key=lambda handle: not _is_star(handle))
        columns, rows = _legend_grid([_label(each) for each in ordered], wide - 2 * look.edge)
        head = look.heading * len(heading) + look.line * len(caption) + 2 * look.edge
        foot = look.entry * rows + look.edge
        tall = charts + head + foot
        self.figure.set_size_inches(wide, tall)
        engine: Any = self.figure.get_layout_engine()
        engine.set(rect=(0.005, foot / tall, 0.99, charts / tall))
        self._write(heading, caption)
        if ordered:
            self._draw_legend(ordered, columns)
        return self.figure

    def _draw_trade_off(self) -> None:
        """The trade-off with its legend above, and named points of the front below."""
        if self.beside is None:
            return
        ax, letters = self.beside.subplots(), int(self.look.letters * self.look.beside)
        draw_trade_off(ax, self.content)
        ax.legend(frameon=False, fontsize=9, loc="lower left", bbox_to_anchor=(0, 1.0), ncols=2,
                  borderaxespad=0.1)  # fmt: skip
        lines = [in_lines(line, letters, 2) for line in named_told(self.content)]
        self.beside.supxlabel("\n".join(lines), x=0.02, ha="left", fontsize=9, color=self.look.grey)

    def _write(self, heading: list[str], caption: list[str]) -> None:
        look = self.look
        wide, tall = self.figure.get_size_inches()
        left, top = look.edge / wide, 1 - look.edge / tall
        self.figure.text(left, top, "\n".join(heading), fontweight="bold", fontsize=11, va="top")
        self.figure.text(left, top - look.heading * len(heading) / tall, "\n".join(caption),
                         fontsize=9.5, va="top", color=look.grey, linespacing=1.3)  # fmt: skip

    def _draw_legend(self, handles: list[Any], columns: int) -> None:
        """A legend at the foot."""
        wide, tall = self.figure.get_size_inches()
        place = self.look.edge / wide, 0.3 * self.look.edge / tall
        self.figure.legend(
            handles=handles, ncols=columns,
            loc="lower left", bbox_to_anchor=place, frameon=False, fontsize=9, columnspacing=1.4,
            handlelength=2.0, handleheight=1.3, borderaxespad=0,
        )  # fmt: skip


def stars(ax: Any) -> list[Any]:
    """The mark of the best point in a map, as an entry of a legend; none where there is none."""
    return [collection for collection in ax.collections if _is_star(collection)]


def _is_star(artist: Any) -> bool:
    return _label(artist).startswith(("best: ", "largest: "))


def _label(artist: Any) -> str:
    return str(artist.get_label())


def _legend_grid(words: list[str], inches: float) -> tuple[int, int]:
    """Columns and rows of a legend: as many columns as fit."""
    lengths = [len(entry) for entry in words]
    for columns in range(len(words), 0, -1):
        # As Matplotlib fills columns, the longer ones first.
        widths = [0.62 + 0.075 * max(part) for part in np.array_split(lengths, columns)]
        if sum(widths) <= inches or columns == 1:
            return columns, -(-len(words) // columns)
    return 1, 0


def _caption(content: MapContent) -> Iterable[str]:
    """What a reader has to know: counts, seeds, what is drawn."""
    study = content.table.study
    if study.file.description:
        yield study.file.description
    yield "; ".join(filter(None, (content.counts(), content.seeds_told())))
    if len(content.axes) < len(study.points.axes):
        yield f"at each point the largest {content.value} over all other keys"
    if len(content.axes) == 3 and not content.sampled:
        yield f"slices of {content.axes[2].name}"
    elif len(content.axes) > 3 or (len(content.axes) == 3 and content.sampled):
        yield from _many_told(content)


def _many_told(content: MapContent) -> Iterable[str]:
    pairs = PairLook()
    if not content.sampled or len(content.places) > pairs.dots:
        yield (
            f"each cell of a pair: the largest {content.value} over all other keys; grey where "
            "none is solved"
        )
    else:
        yield f"grey crosses: not solved; lines below: the {pairs.first} best and others, by rank"
    yield (
        "importance: share of the variance that the key alone explains, Var E[value | key] / "
        "Var value, from bins (ε²); shares need not add up to 100 %"
    )
    left_out = len(content.axes) - pairs.keys
    if left_out > 0:
        yield f"pairs of the {pairs.keys} most important keys of {len(content.axes)}"


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
        if len(content.places) > HeatLook.dots:
            handles = [Patch(color=HeatLook.unsolved, label="no point is solved")]
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
