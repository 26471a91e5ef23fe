"""The values of a study over the ranks of its points as a drawing, with a legend of colours."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from copose.live.plots.svg import (
    PLOT,
    VIRIDIS,
    ColorScale,
    PlotFrame,
    color_bar,
    dot,
    drawing,
    text,
    ticks,
)
from copose.poses import Array


@dataclass(frozen=True)
class RankingLook:
    """Sizes of the drawing, px."""

    width: float = 300.0
    height: float = 150.0
    top: float = 20.0
    bottom: float = 18.0
    left: float = 44.0
    right: float = 8.0
    bar: float = 10.0  # width of the bar of colours
    most: int = 300  # corners of the curve at most
    ticks: int = 4  # of the values, at most


def ranking_svg(
    values: Array, scale: ColorScale, title: str, rank: int | None,
    look: RankingLook = RankingLook(),
) -> str:  # fmt: skip
    """The curve of values, from the best to the worst, over ranks, beside a bar of their colours; a
    rank, from 0, is marked.
    """
    low, high = scale.low, scale.high
    if not high > low:
        low, high = low - 0.5, low + 0.5
    left = look.left + look.bar + 8
    frame = PlotFrame(
        left, look.top, look.width - left - look.right, look.height - look.top - look.bottom,
        (0.0, float(max(len(values) - 1, 1))), (low, high),
    )  # fmt: skip
    shown = np.clip(values, low, high)
    ranks = np.unique(np.linspace(0, len(values) - 1, min(len(values), look.most)).round())
    corners = ranks.astype(np.intp)
    parts = [
        text(0, 12, title, more=f'font-size="{PLOT.letters}"'),
        *_bar(frame, look, fallen=bool(values[-1] < low)),
        frame.rectangle('fill="none" stroke="currentColor" stroke-opacity="0.3"'),
        frame.line(ranks, shown[corners], f'stroke="{PLOT.curve}" stroke-width="1.8"'),
        text(frame.left, look.height - 5, "best"),
        text(frame.right, look.height - 5, f"{len(values)} solved", "end"),
    ]
    if rank is not None:
        x, y = frame.across(rank), frame.down(float(shown[rank]))
        parts += [
            f'<path d="M{x:.1f} {frame.top:.1f}V{frame.bottom:.1f}" stroke="{PLOT.present}" '
            'stroke-opacity="0.5"/>',
            dot(x, y),
        ]
    return drawing(look.width, look.height, parts, f"{title}, from the best to the worst")


def _bar(frame: PlotFrame, look: RankingLook, *, fallen: bool) -> Iterator[str]:
    """The bar that tells values by their colours."""
    bar = PlotFrame(look.left, frame.top, look.bar, frame.height, (0, 1), frame.y)
    yield from color_bar("rank", bar, VIRIDIS)
    for value, said in ticks(*frame.y, look.ticks):
        yield text(look.left - 4, bar.down(value) + 3, said, "end")
    if fallen:
        yield text(look.left - 4, frame.bottom + 11, "and less", "end")
