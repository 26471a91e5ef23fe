"""Many keys at once: each pair of them, their importance, parallel coordinates."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from copose.poses import Array, Indices
from copose.report.look import LOOK
from copose.report.studies.charts.heat_map import ValueScale, apart, draw_best, draw_largest
from copose.report.studies.charts.key_scales import broken
from copose.report.studies.key_axes import KeyAxis, in_lines
from copose.report.studies.map_content import MapContent
from copose.report.words import percent


@dataclass(frozen=True)
class BinOptions:
    """Options of the bins of a key's values."""

    most: int = 12  # bins of a key with many different values
    points: int = 12  # that a bin has at least, of a key with many different values


def first_order_share(along: Array, values: Array) -> float:
    """The share of the variance of some values that a key alone explains, from 0 to 1.

    It is the first-order index S = Var(E[value | key]) / Var(value), estimated by bins of the key
    as ε² = (SS_between − (bins − 1) · MS_within) / SS_total, which is 0 on average where the key
    does not count; negative estimates are 0. What keys do only together is in none of their shares,
    so that these need not add up to 1.

    Args:
        along: the key at each point, (count,), cut into bins of about equal counts; few different
            values are a bin each.
        values: finite, (count,).
    """
    count = len(values)
    total = float(((values - values.mean()) ** 2).sum()) if count else 0.0
    bins = _bins(along)
    number = int(bins.max(initial=-1)) + 1
    if number < 2 or count <= number or total <= 1e-24 * count * float((values**2).max()):
        return 0.0
    counts = np.bincount(bins, minlength=number)
    means = np.bincount(bins, values, number) / counts
    between = float((counts * (means - values.mean()) ** 2).sum())
    within = (total - between) / (count - number)
    return min(max((between - (number - 1) * within) / total, 0.0), 1.0)


def _bins(along: Array) -> Indices:
    """The number of the bin of each point, without empty bins."""
    different = np.unique(along)
    most = max(2, min(BinOptions.most, len(along) // BinOptions.points))
    if len(different) > most:
        edges = np.quantile(along, np.linspace(0, 1, most + 1)[1:-1])
        along = np.searchsorted(np.unique(edges), along, side="right").astype(float)
    bins: Indices = np.unique(along, return_inverse=True)[1]
    return bins


@dataclass(frozen=True)
class PairLook:
    """Look of charts of many keys."""

    keys: int = 5  # at most
    dots: int = 3000  # points that are dots; of more the largest number in each cell is drawn
    cells: int = 40  # along each axis then
    lines: int = 300  # of parallel coordinates
    first: int = 30  # of them the best; the others are evenly chosen by rank
    named: int = 8  # names beside an axis of parallel coordinates
    counted: int = 200_000  # points that shares of variance are estimated from
    mixed: int = 10  # solved points, and others, from which on it is told what they depend on
    unsolved: str = "#BBBBBB"  # of points without a number


@dataclass(frozen=True)
class KeyShare:
    """The share of a number's variance that a key explains."""

    axis: KeyAxis
    value: float  # its share of the variance of the number, over solved points
    # Its share of the variance of whether a point is solved; None where all are or none.
    solved: float | None


def key_shares(content: MapContent) -> list[KeyShare]:
    """How much each key counts for the number, the most first, and for whether there is one."""
    step = slice(None, None, -(-len(content.places) // PairLook.counted))
    values, solved = content.places.values[step], content.places.solved[step]
    done = content.places.done[step]
    mixed = min(solved.sum(), done.sum() - solved.sum()) >= PairLook.mixed
    shares = []
    for axis in content.axes:
        along = content.along(axis)[step]
        value = first_order_share(along[solved], values[solved])
        whether = first_order_share(along[done], solved[done].astype(float)) if mixed else None
        shares.append(KeyShare(axis, value, whether))
    return sorted(shares, key=lambda share: -share.value)


def most_important(content: MapContent) -> MapContent:
    """The map with no more keys than charts have room for, the most important first."""
    first = [share.axis for share in key_shares(content)][: PairLook.keys]
    return replace(content, axes=tuple(first))


def draw_pair(ax: Axes, content: MapContent, scale: ValueScale) -> None:
    """Two keys, coloured by the number: points, the best in front; of many, and of a grid, the
    largest number in each cell whatever the other keys are.
    """
    solved, values = content.places.solved, content.places.values
    if len(solved) > PairLook.dots or not content.sampled:
        draw_largest(ax, content, scale, cells=PairLook.cells)
    else:
        along = apart(content, 0), apart(content, 1)
        ax.plot(along[0][~solved], along[1][~solved], linestyle="", marker="x", markersize=3,
                color=PairLook.unsolved, zorder=1)  # fmt: skip
        order = np.flatnonzero(solved)[np.argsort(values[solved])]
        ax.scatter(along[0][order], along[1][order], c=values[order], s=14, edgecolor="none",
                   rasterized=True, zorder=2, **scale.keywords)  # fmt: skip
    draw_best(ax, content, size=130)


def draw_importance(ax: Axes, content: MapContent) -> None:
    """Bars of each key's shares of the variance: of the number, and of whether there is one."""
    shares = key_shares(content)
    rows = np.arange(len(shares), dtype=float)
    mixed = shares[0].solved is not None
    height = 0.28 if mixed else 0.4
    kinds = [([share.value for share in shares], LOOK.system, content.value)]
    if mixed:
        solved = [share.solved or 0.0 for share in shares]
        kinds.append((solved, LOOK.before, "whether a point is solved"))
    for k, (lengths, color, name) in enumerate(kinds):
        places = rows + (k - (len(kinds) - 1) / 2) * height
        bars = ax.barh(places, [100 * share for share in lengths], 0.9 * height, color=color,
                       label=name)  # fmt: skip
        ax.bar_label(bars, [f"{percent(share)} %" for share in lengths], fontsize=8, padding=3)
    for row, share in zip(rows.tolist(), shares, strict=True):
        above = row - height * len(kinds) / 2
        ax.annotate(share.axis.name, (0, above), xytext=(3, 0), textcoords="offset points",
                    fontsize=9, va="bottom")  # fmt: skip
    ax.set_yticks([])
    ax.set_xlim(0, 118)
    ax.set_ylim(len(shares) - 0.6, -0.8)
    ax.set_xticks([])
    ax.tick_params(length=0)
    ax.spines[["top", "right", "bottom"]].set_visible(False)
    ax.set_title("importance: what the key alone explains of the variance of", loc="left",
                 fontsize=10, pad=22)  # fmt: skip
    ax.legend(frameon=False, fontsize=9, loc="lower left", bbox_to_anchor=(0, 0.99), ncols=2,
              borderaxespad=0.1)  # fmt: skip


def draw_parallel(ax: Axes, content: MapContent, scale: ValueScale) -> None:
    """Parallel coordinates: a line for each of some solved points, the best ones in front."""
    chosen = _chosen_lines(content.places.values)
    heights, ends = zip(*(_heights(content, axis, chosen) for axis in content.axes), strict=True)
    count = len(content.axes)
    lines = np.stack([np.broadcast_to(np.arange(count), (len(chosen), count)),
                      np.stack(heights, axis=1)], axis=2)  # fmt: skip
    colored = LineCollection(list(lines), linewidths=1.2, alpha=0.75, **scale.keywords)
    colored.set_array(content.places.values[chosen])
    ax.add_collection(colored)
    if content.best is not None and len(chosen):
        ax.plot(range(count), lines[-1, :, 1], color=LOOK.system, linewidth=3, zorder=4,
                marker="*", markersize=13, markerfacecolor="white", markeredgecolor=LOOK.ink,
                )  # fmt: skip
    for k, (axis, (low, high)) in enumerate(zip(content.axes, ends, strict=True)):
        ax.plot([k, k], [0, 1], color=LOOK.ink, linewidth=1, zorder=3)
        if axis.labels is not None:
            _name_rows(ax, k, axis.labels)
        else:
            ax.text(k, -0.03, axis.value(low), ha="center", va="top", fontsize=9)
            ax.text(k, 1.03, axis.value(high), ha="center", va="bottom", fontsize=9)
        ax.text(k, -0.14, broken(axis.title, 30), ha="center", va="top", fontsize=10)
    ax.set(xlim=(-0.25, count - 0.7), ylim=(-0.28, 1.12))
    ax.axis("off")


def _name_rows(ax: Axes, k: int, labels: Sequence[str]) -> None:
    """Names beside an axis of parallel coordinates, towards the inside of the chart."""
    last = len(labels) - 1
    for row in sorted({*range(0, last + 1, -(-len(labels) // PairLook.named)), last}):
        ax.annotate(in_lines(labels[row], 22), (k, row / max(last, 1)), xytext=(7, 0), va="center",
                    textcoords="offset points", fontsize=8, zorder=5,
                    bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.6},
                    )  # fmt: skip


def _chosen_lines(values: Array) -> Indices:
    """Solved points that have a line: the best, and of the others some by rank; the best last."""
    solved = np.flatnonzero(np.isfinite(values))
    ranked = solved[np.argsort(values[solved], kind="stable")]
    if len(ranked) <= PairLook.lines:
        return ranked
    others, first = ranked[: -PairLook.first], ranked[-PairLook.first :]
    some = np.linspace(0, len(others) - 1, PairLook.lines - PairLook.first).round().astype(np.intp)
    return np.concatenate([others[some], first])


def _heights(
    content: MapContent, axis: KeyAxis, chosen: Indices
) -> tuple[Array, tuple[float, float]]:
    """Heights of lines on a key's axis, from 0 to 1, and its two ends."""
    along = content.along(axis)
    whole = content.table.study.points.axes[axis.number]
    low, high = whole.lower, whole.upper
    if not math.isfinite(low):
        low, high = float(along.min()), float(along.max())
    return (along[chosen] - low) / max(high - low, 1e-300), (low, high)
