"""Parts of drawings in SVG that are legible on light and on dark ground, and colours of values."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape

import numpy as np

from copose.poses import Array, Mask

VIRIDIS = (
    "440154", "482878", "3e4989", "31688e", "26828e", "1f9e89", "35b779", "6ece58", "b5de2b",
    "fde725",
)  # fmt: skip
"""Matplotlib's viridis from low to high at equal distances."""


def color_table(colors: tuple[str, ...] = VIRIDIS) -> Array:
    """256 colours from low to high, (256, 3), 0 to 255."""
    anchors = np.array([[int(c[k : k + 2], 16) for k in (0, 2, 4)] for c in colors])
    at = np.linspace(0, len(anchors) - 1, 256)
    return np.column_stack([np.interp(at, np.arange(len(anchors)), column) for column in anchors.T])


@dataclass(frozen=True)
class ColorScale:
    """The colours of values between two; beyond them those of the ends."""

    low: float  # value of the lowest colour
    high: float  # of the highest

    @classmethod
    def of(cls, values: Array, fallen: float = 0.02) -> ColorScale:
        """The scale of some values; of a part of them, which fall far near singularities, the
        colour is the lowest. Those that are not finite do not count.
        """
        values = values[np.isfinite(values)]
        if not len(values):
            return cls(0.0, 1.0)
        return cls(float(np.quantile(values, fallen, method="lower")), float(values.max()))

    @cached_property
    def _table(self) -> Array:
        return color_table()

    def colors(self, values: Array) -> np.ndarray:
        """Red, green and blue of values, (count, 3) of uint8."""
        width = self.high - self.low
        part = (values - self.low) / width if width > 0 else np.ones(len(values))
        indices = (np.clip(part, 0.0, 1.0) * 255).astype(np.intp)
        return self._table[indices].round().astype(np.uint8)


@dataclass(frozen=True)
class PlotLook:
    """Colours of all drawings, which stand out on white and on black, and sizes of letters."""

    curve: str = "#2F8FD0"
    present: str = "#E8590C"  # where the arms are
    best: str = "#E0A100"  # where the objective is best
    touching: str = "#D03030"  # limits, and what touches
    others: tuple[str, ...] = (  # further curves
        "#1FA37A", "#C76BA0", "#8C8C2E", "#7A6FD0", "#B0703C", "#5AA9C8",
    )  # fmt: skip
    letters: int = 11  # size of titles, px
    small: float = 9.5  # size of all other letters, px
    letter: float = 0.56  # width of a letter, about, of its size


PLOT = PlotLook()


@dataclass(frozen=True)
class PlotFrame:
    """A rectangle that numbers are drawn in."""

    left: float  # its left edge, px
    top: float  # its upper edge, px
    width: float  # px
    height: float  # px
    x: tuple[float, float]  # numbers at its left and right edge
    y: tuple[float, float]  # numbers at its lower and upper edge

    def across(self, x: float) -> float:
        """The place of a number from left to right, px."""
        return self.left + (x - self.x[0]) / (self.x[1] - self.x[0]) * self.width

    def down(self, y: float) -> float:
        """The place of a number from top to bottom, px."""
        return self.top + (self.y[1] - y) / (self.y[1] - self.y[0]) * self.height

    @property
    def right(self) -> float:
        """Its right edge, px."""
        return self.left + self.width

    @property
    def bottom(self) -> float:
        """Its lower edge, px."""
        return self.top + self.height

    def rectangle(self, attributes: str) -> str:
        """The rectangle itself."""
        return (f'<rect x="{self.left:.1f}" y="{self.top:.1f}" width="{self.width:.1f}" '
                f'height="{self.height:.1f}" {attributes}/>')  # fmt: skip

    def line(self, x: Array, y: Array, attributes: str) -> str:
        """A line through points; none of fewer than two."""
        if len(x) < 2:
            return ""
        pairs = zip(map(self.across, x), map(self.down, y), strict=True)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in pairs)
        return f'<polyline points="{points}" fill="none" {attributes}/>'


def levels(frame: PlotFrame, marks: Iterable[tuple[float, str]]) -> Iterator[str]:
    """Lines across a frame at some numbers, with words left of them."""
    for value, said in marks:
        y = frame.down(value)
        yield (f'<line x1="{frame.left:.1f}" x2="{frame.right:.1f}" y1="{y:.1f}" y2="{y:.1f}" '
               'stroke="currentColor" stroke-opacity="0.13"/>')  # fmt: skip
        yield text(frame.left - 4, y + 3, said, "end")


def runs(mask: Mask) -> list[slice]:
    """Runs of what is marked."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def color_bar(name: str, frame: PlotFrame, colors: Sequence[str]) -> Iterator[str]:
    """A frame filled with colours from low to high, under a name of its own on the page."""
    steps = len(colors) - 1
    stops = "".join(
        f'<stop offset="{k / steps:.3f}" stop-color="#{color}"/>' for k, color in enumerate(colors)
    )
    yield (f'<defs><linearGradient id="{name}" x1="0" y1="1" x2="0" y2="0">{stops}'
           '</linearGradient></defs>')  # fmt: skip
    yield frame.rectangle(f'fill="url(#{name})"')


def drawing(width: float, height: float, parts: Sequence[str], name: str) -> str:
    """A whole drawing of some parts, with its name for those who do not see it."""
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" '
        f'width="100%" style="max-width:{width:g}px;display:block" role="img" '
        f'aria-label="{escape(name, quote=True)}" font-family="system-ui,sans-serif" '
        f'font-size="{PLOT.small:g}" fill="currentColor">{"".join(parts)}</svg>'
    )


def text(x: float, y: float, what: str, anchor: str = "start", more: str = "") -> str:
    """A line of letters; the anchor says which end of it is there."""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" {more}>{escape(what)}</text>'


def upright(x: float, y: float, what: str, anchor: str = "start", more: str = "") -> str:
    """A line of letters from below upwards."""
    return text(x, y, what, anchor, f'transform="rotate(-90 {x:.1f} {y:.1f})" {more}')


def width_of(what: str, size: float = PLOT.small) -> float:
    """The width of a line of letters, about, px."""
    return PLOT.letter * size * len(what)


def number(value: float, step: float = 0.0) -> str:
    """A number for people; to the digit that a step between ticks has."""
    if step > 0:
        places = max(0, -math.floor(math.log10(step) + 1e-9))
        places += not math.isclose(round(step, places), step, rel_tol=1e-6)
        return f"{value:.{places}f}".replace("-", "−")
    return f"{value:.4g}".replace("-", "−")


def ticks(low: float, high: float, most: int) -> list[tuple[float, str]]:
    """Round numbers between two, at most so many, each with its words."""
    rough = (high - low) / max(1, most)
    if not rough > 0:
        return [(low, number(low))]
    power = 10.0 ** math.floor(math.log10(rough))
    round_steps = (1.0, 2.0, 2.5, 5.0, 10.0)
    step = power * next(k for k in round_steps if k * power >= rough * (1 - 1e-9))
    places = np.arange(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1) * step
    return [(float(x), number(float(x) + 0.0, step)) for x in places]


def dot(x: float, y: float, radius: float = 4.5) -> str:
    """A dot where the arms are."""
    return (f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:g}" fill="{PLOT.present}" '
            f'stroke="#fff" stroke-width="1.3"/>')  # fmt: skip


def star(x: float, y: float, radius: float = 6.0, colour: str = PLOT.best) -> str:
    """A star where the objective is best."""
    corners = []
    for k in range(10):
        r = radius * (1.0 if k % 2 == 0 else 0.42)
        turn = math.pi * k / 5
        corners.append(f"{x + r * math.sin(turn):.1f},{y - r * math.cos(turn):.1f}")
    return (f'<polygon points="{" ".join(corners)}" fill="{colour}" stroke="#fff" '
            f'stroke-width="1" paint-order="stroke"/>')  # fmt: skip


def legend(
    x: float, y: float, now: float | None, best: float | None, unit: str, rough: bool
) -> str:
    """A line with the values at a dot and at a star."""
    unit = "" if unit in ("", "1", "log") else f" {unit}"
    parts = []
    for mark, name, value in ((dot, "now", now), (star, "best", best)):
        if value is None:
            continue
        about = "≈ " if rough else ""
        said = f"{name} {about}{number(value)}{unit}"
        parts += [mark(x + 5, y - 4), text(x + 14, y, said, more=f'font-size="{PLOT.letters}"')]
        x += 14 + width_of(said, PLOT.letters) + 12
    return "".join(parts)


def hatch(name: str, colour: str, strength: float) -> str:
    """A pattern of slanting lines to fill with."""
    return (
        f'<pattern id="{name}" width="6" height="6" patternUnits="userSpaceOnUse" '
        f'patternTransform="rotate(45)"><rect width="6" height="6" fill="{colour}" '
        f'fill-opacity="{strength / 2.5:.3g}"/><line x1="0" y1="0" x2="0" y2="6" '
        f'stroke="{colour}" stroke-opacity="{strength:g}" stroke-width="1.6"/></pattern>'
    )
