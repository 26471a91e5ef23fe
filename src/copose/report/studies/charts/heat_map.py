"""Heat maps of a number over two keys: of a grid, in slices of a third key, of a sample."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.ticker import MaxNLocator

from copose.poses import Array, Indices
from copose.report.look import LOOK
from copose.report.studies.charts.endings import draw_ending_marks, draw_endings
from copose.report.studies.charts.key_scales import cell_edges, label_scale
from copose.report.studies.map_content import MapContent
from copose.report.words import three


@dataclass(frozen=True)
class HeatLook:
    """Look of heat maps."""

    colors: str = "viridis"  # perceptually uniform
    contours: int = 7  # at most
    contoured: int = 10  # cells along each axis of a grid that has contours
    most_contoured: int = 400  # of larger grids noise is all that contours show
    finest: int = 700  # cells along an axis
    low_share: float = 0.02  # of the smallest numbers that may lie below the colours
    outlying: float = 0.4  # share of the range that they then save
    slices: int = 12  # at most
    unsolved: str = "#E0E0E0"  # where no point is solved
    dots: int = 20_000  # of a sample; of more the largest number of each of many cells is drawn
    cells: int = 150  # along each axis then


@dataclass(frozen=True)
class ValueScale:
    """Colours of numbers, the same in all charts of a picture."""

    low: float
    high: float
    below: bool  # whether some numbers are below the colours

    @classmethod
    def of(cls, values: Array) -> ValueScale:
        """Colours of some values, nan where there is none; few outliers do not stretch it."""
        known = values[np.isfinite(values)]
        if not known.size:
            return cls(0.0, 1.0, below=False)
        low, high = float(known.min()), float(known.max())
        usual = float(np.quantile(known, HeatLook.low_share, method="higher"))
        if usual - low > HeatLook.outlying * (high - low):
            return cls(usual, high, below=True)
        if not high - low > 1e-9 * max(abs(low), abs(high)):
            half = 0.5 * max(abs(low), 1e-9)
            return cls(low - half, high + half, below=False)
        return cls(low, high, below=False)

    @property
    def norm(self) -> Normalize:
        """From numbers to shares of the colour map."""
        return Normalize(self.low, self.high)

    @property
    def keywords(self) -> dict[str, Any]:
        """Keywords of what is coloured by it."""
        return {"cmap": HeatLook.colors, "norm": self.norm}

    def levels(self, count: int) -> Array:
        """Round numbers between the two ends."""
        ticks = np.asarray(MaxNLocator(count).tick_values(self.low, self.high))
        return ticks[(ticks > self.low) & (ticks < self.high)]


def draw_color_bar(
    figure: Any, axes: Any, content: MapContent, scale: ValueScale, lines: Any = None, **place: Any
) -> None:
    """The colour bar of a picture, with the lines of its contours; none where nothing is solved."""
    if not content.places.solved.any():
        return
    mappable = ScalarMappable(norm=scale.norm, cmap=HeatLook.colors)
    bar = figure.colorbar(mappable, ax=axes, extend="min" if scale.below else "neither", **place)
    bar.set_label(content.title)
    bar.ax.tick_params(labelsize=9)
    bar.outline.set_visible(False)
    if lines is not None:
        bar.add_lines(lines)


def draw_heat(
    ax: Axes, content: MapContent, scale: ValueScale, layer: int | None = None,
) -> Any:  # fmt: skip
    """A heat map of a grid along the first two axes of a map; where it has a third axis, of a layer
    along that.

    Returns:
        Contours, None where there are none.
    """
    values, codes = content.grid(content.places.values), content.grid(content.places.codes)
    if layer is not None:
        values, codes = values[:, :, layer], codes[:, :, layer]
    x, columns = _ascending(content, 0)
    y, rows = _ascending(content, 1)
    values, codes = values[np.ix_(columns, rows)], codes[np.ix_(columns, rows)]
    edges = cell_edges(x), cell_edges(y)
    _draw_cells(ax, edges, values, scale)
    draw_endings(ax, codes, edges, content)
    ax.set(xlim=edges[0][[0, -1]], ylim=edges[1][[0, -1]])
    if content.axes[1].labels is not None:
        ax.invert_yaxis()
    return _draw_contours(ax, (x, y), values, content, scale)


def _draw_cells(ax: Axes, edges: tuple[Array, Array], values: Array, scale: ValueScale) -> None:
    """Colour cells; of very many those that pixels would leave out are left out."""
    steps = [max(1, -(-size // HeatLook.finest)) for size in values.shape]
    x, y = (np.append(edge[:-1][::step], edge[-1]) for edge, step in zip(edges, steps, strict=True))
    ax.pcolorfast(x, y, values[:: steps[0], :: steps[1]].T, **scale.keywords)


def _ascending(content: MapContent, k: int) -> tuple[Array, Any]:
    """The different places along an axis of the map, ascending, and their numbers in the grid."""
    axis = content.table.study.points.axes[content.axes[k].number]
    along = np.arange(len(axis.rows or ())) if axis.numbers is None else axis.numbers
    return np.unique(along, return_index=True)


def _draw_contours(
    ax: Axes, centres: tuple[Array, Array], values: Array, content: MapContent, scale: ValueScale,
) -> Any:  # fmt: skip
    """Lines of equal numbers; None where the grid is too coarse, too fine or of names."""
    if any(axis.labels is not None for axis in content.axes[:2]) or not (
        HeatLook.contoured <= min(values.shape) <= max(values.shape) <= HeatLook.most_contoured
    ):
        return None
    known = np.isfinite(values)
    levels = scale.levels(HeatLook.contours)
    if known.any():
        low, high = values[known].min(), values[known].max()
        levels = levels[(levels > low) & (levels < high)]
    if not known.any() or not levels.size:
        return None
    masked = np.ma.masked_invalid(values.T)
    return ax.contour(*centres, masked, levels=levels, colors="white", linewidths=0.8,
                      linestyles="-", alpha=0.7)  # fmt: skip


def draw_best(ax: Axes, content: MapContent, *, size: float = 260) -> None:
    """Mark the best place."""
    place = content.best
    if place is None:
        return
    number = three(float(content.places.values[place]))
    x, y = content.where(place)[:2]
    ax.scatter([x], [y], s=size, marker="*", facecolor="white", edgecolor=LOOK.ink, linewidth=1.1,
               zorder=6, clip_on=False, label=f"{content.best_word}: {number}")  # fmt: skip


def label_keys(ax: Axes, content: MapContent, *, which: str = "xy", few: int | None = None) -> None:
    """Name and tick the two axes."""
    for k, name in enumerate(("x", "y")):
        along = np.unique(content.along(content.axes[k])) if not content.sampled else np.zeros(99)
        label_scale(ax, name, content.axes[k], along, titled=name in which, few=few)  # type: ignore[arg-type]


def chosen_layers(content: MapContent) -> list[int]:
    """Rows of the third axis that have a slice, evenly chosen, that of the best among them."""
    count = len(content.table.study.points.axes[content.axes[2].number].rows or ())
    if count <= HeatLook.slices:
        return list(range(count))
    layers: Indices = np.linspace(0, count - 1, HeatLook.slices).round().astype(np.intp)
    if content.best is not None:
        best = content.table.study.points.indices(int(content.places.points[content.best]))
        layer = best[content.axes[2].number]
        layers[np.abs(layers - layer).argmin()] = layer
    return [int(layer) for layer in layers]


def draw_dots(ax: Axes, content: MapContent, scale: ValueScale) -> None:
    """A sample over two keys: a dot a point, or the largest number of each of many cells."""
    if len(content.places) > HeatLook.dots:
        draw_largest(ax, content, scale, cells=HeatLook.cells)
        return
    along = [apart(content, k) for k in (0, 1)]
    draw_ending_marks(ax, (along[0], along[1]), content)
    order = np.flatnonzero(content.places.solved)
    size = max(6.0, min(36.0, 9000 / max(len(content.places), 1)))
    ax.scatter(along[0][order], along[1][order], c=content.places.values[order], s=size,
               edgecolor="none", rasterized=True, zorder=2, **scale.keywords)  # fmt: skip


def apart(content: MapContent, k: int) -> Array:
    """Where the places are along an axis of the map; those of a name spread about it, so that they
    do not hide one another.
    """
    along = content.along(content.axes[k])
    if content.axes[k].labels is None:
        return along
    golden = 0.6180339887498949 * (k + 1)
    return along + 0.5 * (np.arange(len(along)) * golden % 1 - 0.5)


def draw_largest(
    ax: Axes, content: MapContent, scale: ValueScale, *, cells: int, block: int = 100_000
) -> None:
    """The largest number in each cell over two keys, whatever the others are; cells in which
    nothing is solved are grey.

    Args:
        ax: the axes.
        content: the map.
        scale: of colours.
        cells: at most, along each axis.
        block: number of points that are looked at at once.
    """
    x, y = (content.along(axis) for axis in content.axes[:2])
    edges = _edges(x, cells), _edges(y, cells)
    shape = len(edges[0]) - 1, len(edges[1]) - 1
    largest, met = np.full(shape[0] * shape[1], np.nan), np.zeros(shape[0] * shape[1], dtype=bool)
    for begin in range(0, len(x), block):
        part = slice(begin, begin + block)
        cell = _cells(x[part], edges[0]) * shape[1] + _cells(y[part], edges[1])
        np.fmax.at(largest, cell, content.places.values[part])
        met[cell[content.places.done[part]]] = True
    grey = np.where(np.isnan(largest) & met, 1.0, np.nan)
    ax.pcolorfast(*edges, grey.reshape(shape).T, cmap=ListedColormap([HeatLook.unsolved]))
    ax.pcolorfast(*edges, largest.reshape(shape).T, **scale.keywords)
    if content.axes[1].labels is not None:
        ax.invert_yaxis()


def _cells(along: Array, edges: Array) -> Indices:
    """The cell of each point along an axis."""
    cells: Indices = np.searchsorted(edges, along, side="right") - 1
    return np.clip(cells, 0, len(edges) - 2)


def _edges(along: Array, cells: int) -> Array:
    """Edges of cells along an axis: one for each value where there are few, else so many."""
    different = np.unique(along)
    if len(different) <= cells:
        return cell_edges(different)
    return np.linspace(different[0], different[-1], cells + 1)
