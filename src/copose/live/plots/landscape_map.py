"""The objective over the self-motions of two arms as a drawing: a map to be moved in."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from PIL import Image

from copose.live.plots.svg import Frame, dot, drawing, legend, star, text, ticks, upright
from copose.poses import Array, Mask
from copose.posture.landscape.objective_map import Landscape

# Colours from low to high: matplotlib's viridis at equal distances.
_COLOURS = (
    "440154", "482878", "3e4989", "31688e", "26828e", "1f9e89", "35b779", "6ece58", "b5de2b",
    "fde725",
)  # fmt: skip
# Pixels of the picture along each side, about.
_PIXELS = 240
# Bands of values between which lines are drawn, and how much darker these are.
_BANDS = 12
_LINE = 0.72
# Of what is not allowed: how strong its colours are, and the distance and width of the lines over
# it, pixels.
_FADED = 0.3
_APART = 6
_WIDE = 1
_GREY = 128.0
_OPACITY = 105
# Values below this part of those allowed have the lowest colour: near singular postures they fall
# to −∞.
_FALLEN = 0.04
# Margins, px.
_TOP = 20.0
_BOTTOM = 30.0
_LEFT = 42.0
_RIGHT = 52.0
_BAR = 9.0
_TICKS = 4


def map_svg(
    landscape: Landscape,
    *,
    present: tuple[float, float] | None = None,
    value: float | None = None,
    width: float = 300.0,
    height: float = 270.0,
) -> str:
    """The objective over the self-motions of two arms: the first upwards, the second to the right.

    What limits or bodies do not allow is faded and hatched.

    Args:
        landscape: the map.
        present: arc lengths at the arms' posture, in place of the map's.
        value: of the objective there, in place of the map's.
        width: of the drawing, px; `height` alike.
        height: px.
    """
    here = landscape.present
    if here is not None:
        present = here[:2] if present is None else present
        value = here[2] if value is None else value
    low, high = _range(landscape)
    rows, columns = landscape.rows, landscape.columns
    frame = Frame(_LEFT, _TOP, width - _LEFT - _RIGHT, height - _TOP - _BOTTOM,
                  _cells(columns), _cells(rows))  # fmt: skip
    best = landscape.best
    parts = [legend(4, 13, value, None if best is None else best[2], landscape.unit,
                    landscape.estimated)]  # fmt: skip
    sharp = "" if min(len(rows), len(columns)) > _PIXELS // 3 else "image-rendering:pixelated"
    parts.append(
        f'<image href="{_picture(landscape, low, high)}" preserveAspectRatio="none" '
        f'x="{frame.left:.1f}" y="{frame.top:.1f}" width="{frame.width:.1f}" '
        f'height="{frame.height:.1f}" style="{sharp}"/>'
    )
    parts += [*_axes(frame), *_bar(frame, low, high, landscape.unit)]
    if present is not None:
        x, y = frame.across(present[1]), frame.down(present[0])
        parts.append(
            f'<path d="M{frame.left:.1f} {y:.1f}H{frame.right:.1f}M{x:.1f} {frame.top:.1f}'
            f'V{frame.bottom:.1f}" stroke="#fff" stroke-opacity="0.75" stroke-width="1" '
            'fill="none"/>'
        )
    if best is not None:
        parts.append(star(frame.across(best[1]), frame.down(best[0]), 8.0))
    if present is not None:
        parts.append(dot(frame.across(present[1]), frame.down(present[0]), 4.2))
    one, other = (f"{c.arm}, {c.unit_of_length}" for c in (landscape.first, landscape.second))
    parts.append(text((frame.left + frame.right) / 2, height - 3, other, "middle"))
    parts.append(upright(10, (frame.top + frame.bottom) / 2, one, "middle"))
    name = f"objective over the self-motions of {landscape.first.arm} and {landscape.second.arm}"
    return drawing(width, height, parts, name)


def _cells(s: Array) -> tuple[float, float]:
    """From edge to edge of the cells around arc lengths."""
    low, high = float(s[0]), float(s[-1])
    half = (high - low) / (2 * max(1, len(s) - 1)) if high > low else 0.5
    return low - half, high + half


def _range(landscape: Landscape) -> tuple[float, float]:
    """Values of the lowest and the highest colour."""
    values = landscape.values[landscape.allowed]
    if not len(values):
        values = landscape.values[np.isfinite(landscape.values)]
    if not len(values):
        return 0.0, 1.0
    low, high = float(np.quantile(values, _FALLEN)), float(values.max())
    return (low, high) if high > low else (low - 0.5, low + 0.5)


@lru_cache(maxsize=4)
def _picture(landscape: Landscape, low: float, high: float) -> str:
    """The cells as a picture, the first row lowest, as an address that holds it all."""
    part = (np.nan_to_num(landscape.values, nan=low, neginf=low, posinf=high) - low) / (high - low)
    part, known = np.clip(part, 0.0, 1.0), np.isfinite(landscape.values)
    times = [max(1, round(_PIXELS / count)) for count in part.shape]
    fine = min(part.shape) > _PIXELS // 3
    part = _smooth(part, times) if fine else _larger(part, times)
    known, allowed = _larger(known, times).astype(bool), _allowed(landscape, times)
    colours = _table()[(part * 255).astype(np.intp)].astype(float)
    if fine:
        colours[_lines(part)] *= _LINE
    out = ~allowed
    colours[out] = _GREY + _FADED * (colours[out] - _GREY)
    opacity = np.where(allowed, 255, _OPACITY)
    y, x = np.indices(part.shape)
    lines = out & ((x + y) % _APART < _WIDE)
    colours[lines], opacity[lines] = _GREY, 190
    opacity[~known & ~lines] = 0
    pixels = np.dstack([colours, opacity]).round().astype(np.uint8)[::-1]
    file = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels), "RGBA").save(file, "PNG", compress_level=3)
    return "data:image/png;base64," + base64.b64encode(file.getvalue()).decode()


def _allowed(landscape: Landscape, times: list[int]) -> Mask:
    """Mask of allowed pixels: limits to the pixel, and the rest cell by cell."""
    curves, each = (landscape.first, landscape.second), (landscape.rows, landscape.columns)
    one, other = (curve.within(s) for curve, s in zip(curves, each, strict=True))
    blocked = one[:, None] & other & ~landscape.allowed
    fine = []
    for curve, s, factor in zip(curves, each, times, strict=True):
        low, high = _cells(s)
        at = low + (np.arange(len(s) * factor) + 0.5) / (len(s) * factor) * (high - low)
        fine.append(curve.within(at))
    return np.asarray(fine[0][:, None] & fine[1] & (_larger(blocked, times) == 0))


def _smooth(part: Array, times: list[int]) -> Array:
    """A finer grid, linear between cells."""
    for axis, factor in enumerate(times):
        count = part.shape[axis]
        at = np.clip((np.arange(count * factor) + 0.5) / factor - 0.5, 0, count - 1)
        k = np.minimum(at.astype(np.intp), count - 2)
        rest = np.expand_dims(at - k, 1 - axis)
        part = np.take(part, k, axis) * (1 - rest) + np.take(part, k + 1, axis) * rest
    return part


def _larger(cells: Array | Mask, times: list[int]) -> Array:
    """Each cell as so many pixels."""
    return np.repeat(np.repeat(cells, times[0], axis=0), times[1], axis=1)


def _lines(part: Array) -> Mask:
    """Pixels between one band of values and the next."""
    band = np.floor(part * _BANDS)
    lines = np.zeros(part.shape, dtype=bool)
    lines[:-1] |= band[:-1] != band[1:]
    lines[:, :-1] |= band[:, :-1] != band[:, 1:]
    return lines


def _table() -> Array:
    """256 colours from low to high, (256, 3)."""
    anchors = np.array([[int(c[k : k + 2], 16) for k in (0, 2, 4)] for c in _COLOURS])
    at = np.linspace(0, len(anchors) - 1, 256)
    return np.column_stack([np.interp(at, np.arange(len(anchors)), column) for column in anchors.T])


def _axes(frame: Frame) -> Iterator[str]:
    for value, said in ticks(*frame.x, _TICKS):
        x = frame.across(value)
        yield f'<path d="M{x:.1f} {frame.bottom:.1f}v3" stroke="currentColor"/>'
        yield text(x, frame.bottom + 12, said, "middle")
    for value, said in ticks(*frame.y, _TICKS):
        y = frame.down(value)
        yield f'<path d="M{frame.left:.1f} {y:.1f}h-3" stroke="currentColor"/>'
        yield text(frame.left - 5, y + 3, said, "end")
    yield frame.rectangle('fill="none" stroke="currentColor" stroke-opacity="0.5"')


def _bar(frame: Frame, low: float, high: float, unit: str) -> Iterator[str]:
    """The bar that tells values by their colours."""
    left, steps = frame.right + 7, len(_COLOURS) - 1
    stops = "".join(
        f'<stop offset="{k / steps:.3f}" stop-color="#{colour}"/>'
        for k, colour in enumerate(_COLOURS)
    )
    yield (f'<defs><linearGradient id="bar" x1="0" y1="1" x2="0" y2="0">{stops}'
           '</linearGradient></defs>')  # fmt: skip
    bar = Frame(left, frame.top, _BAR, frame.height, (0, 1), (low, high))
    yield bar.rectangle('fill="url(#bar)"')
    for value, said in ticks(low, high, _TICKS):
        yield text(left + _BAR + 3, bar.down(value) + 3, said)
    yield text(frame.right + 7, frame.bottom + 12, unit if unit != "1" else "")
