"""Two numbers against each other, with the Pareto front."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from copose.poses import Array
from copose.report.look import LOOK
from copose.report.numbers import three
from copose.report.studies.key_axes import titled, value_words
from copose.report.studies.map_content import MapContent, TradeOff


@dataclass(frozen=True)
class TradeOffLook:
    """Look of a trade-off."""

    named: int = 5  # points of the front that are named
    dots: int = 20_000  # points that are drawn; of more those that others hide are left out
    raster: int = 150  # cells along each axis in which then one point is drawn
    letters: str = "ABCDEFGH"


def draw_trade_off(ax: Axes, content: MapContent, look: TradeOffLook = TradeOffLook()) -> None:
    """All solved points, and the Pareto front as a step line with letters at some of its points."""
    trade = content.trade_off
    if trade is None:
        return
    solved = trade.numbers
    if len(content.places) > look.dots:
        solved = _thinned(solved, look.raster)
    ax.plot(*solved, linestyle="", marker="o", markersize=4, color=LOOK.before, alpha=0.7,
            markeredgecolor="none", rasterized=True, label="solved points")  # fmt: skip
    one, other = trade.numbers[:, trade.front]
    # From one point to the next the second number stays what it is until the first one is met.
    ax.plot(one, other, drawstyle="steps-post", color=LOOK.system, linewidth=2)
    ax.plot(one, other, linestyle="", marker="o", markersize=6, color=LOOK.system,
            label=f"Pareto front ({len(trade.front):,}): no point is better in both")  # fmt: skip
    for letter, place in named_points(trade, look):
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
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)


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


def named_points(trade: TradeOff, look: TradeOffLook = TradeOffLook()) -> list[tuple[str, int]]:
    """A few points of the front, evenly chosen with both its ends, and a letter for each."""
    last = len(trade.front) - 1
    chosen = np.linspace(0, max(last, 0), min(look.named, last + 1)).round().astype(np.intp)
    return list(zip(look.letters, trade.front[chosen].tolist(), strict=False))


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
