"""The objective over the self-motions of two arms as a drawing: a map to be moved in."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from PIL import Image

from copose.live.plots.svg import (
    VIRIDIS,
    PlotFrame,
    color_bar,
    color_table,
    dot,
    drawing,
    legend,
    star,
    text,
    ticks,
    upright,
)
from copose.poses import Array, Mask
from copose.posture.landscape.objective_map import Landscape


@dataclass(frozen=True)
class MapLook:
    """Colours and sizes of the map of two self-motions."""

    colours: tuple[str, ...] = VIRIDIS  # from low to high
    pixels: int = 240  # pixels of the picture along each side, about
    bands: int = 12  # bands of values between which lines are drawn
    line: float = 0.72  # brightness of these lines, of the colours below
    faded: float = 0.3  # strength of colours that are not allowed
    apart: int = 6  # distance of the lines over them, pixels
    wide: int = 1  # width of these lines, pixels
    grey: float = 128.0  # grey of these lines, and that colours fade to
    opacity: int = 105  # opacity of what is not allowed
    fallen: float = 0.04  # part of the values of the lowest colour: near singularities all fall
    top: float = 20.0  # margins, px
    bottom: float = 30.0
    left: float = 42.0
    right: float = 52.0
    bar: float = 9.0  # width of the bar of colours, px
    ticks: int = 4  # ticks of an axis, at most


def map_svg(
    landscape: Landscape,
    *,
    present: tuple[float, float] | None = None,
    value: float | None = None,
    width: float = 300.0,
    height: float = 270.0,
    look: MapLook = MapLook(),
) -> str:
    """The objective over the self-motions of two arms: the first upwards, the second to the right.

    Postures that limits or bodies do not allow are faded and hatched. Arc lengths and value at the
    arms' posture may be given in place of the map's.
    """
    current = landscape.present
    if current is not None:
        present = current[:2] if present is None else present
        value = current[2] if value is None else value
    low, high = _range(landscape, look)
    rows, columns = landscape.rows, landscape.columns
    frame = PlotFrame(look.left, look.top, width - look.left - look.right,
                  height - look.top - look.bottom, _cells(columns), _cells(rows))  # fmt: skip
    best = landscape.best
    parts = [legend(4, 13, value, None if best is None else best[2], landscape.unit,
                    landscape.estimated)]  # fmt: skip
    sharp = "" if min(len(rows), len(columns)) > look.pixels // 3 else "image-rendering:pixelated"
    parts.append(
        f'<image href="{_picture(landscape, low, high, look)}" preserveAspectRatio="none" '
        f'x="{frame.left:.1f}" y="{frame.top:.1f}" width="{frame.width:.1f}" '
        f'height="{frame.height:.1f}" style="{sharp}"/>'
    )
    parts += [*_axes(frame, look), *_bar(frame, low, high, landscape.unit, look)]
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
    """The outer edges of the cells around arc lengths."""
    low, high = float(s[0]), float(s[-1])
    half = (high - low) / (2 * max(1, len(s) - 1)) if high > low else 0.5
    return low - half, high + half


def _range(landscape: Landscape, look: MapLook) -> tuple[float, float]:
    """Values of the lowest and the highest colour."""
    values = landscape.values[landscape.allowed]
    if not len(values):
        values = landscape.values[np.isfinite(landscape.values)]
    if not len(values):
        return 0.0, 1.0
    low, high = float(np.quantile(values, look.fallen)), float(values.max())
    return (low, high) if high > low else (low - 0.5, low + 0.5)


@lru_cache(maxsize=4)
def _picture(landscape: Landscape, low: float, high: float, look: MapLook) -> str:
    """The cells as a picture, the first row lowest, in the form of a data address."""
    part = (np.nan_to_num(landscape.values, nan=low, neginf=low, posinf=high) - low) / (high - low)
    part, known = np.clip(part, 0.0, 1.0), np.isfinite(landscape.values)
    times = [max(1, round(look.pixels / count)) for count in part.shape]
    fine = min(part.shape) > look.pixels // 3
    part = _smooth(part, times) if fine else _larger(part, times)
    known, allowed = _larger(known, times).astype(bool), _allowed(landscape, times)
    colours = color_table(look.colours)[(part * 255).astype(np.intp)].astype(float)
    if fine:
        colours[_lines(part, look.bands)] *= look.line
    out = ~allowed
    colours[out] = look.grey + look.faded * (colours[out] - look.grey)
    opacity = np.where(allowed, 255, look.opacity)
    y, x = np.indices(part.shape)
    lines = out & ((x + y) % look.apart < look.wide)
    colours[lines], opacity[lines] = look.grey, 190
    opacity[~known & ~lines] = 0
    pixels = np.dstack([colours, opacity]).round().astype(np.uint8)[::-1]
    file = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels), "RGBA").save(file, "PNG", compress_level=3)
    return "data:image/png;base64," + base64.b64encode(file.getvalue()).decode()


def _allowed(landscape: Landscape, times: list[int]) -> Mask:
    """Mask of allowed pixels: limits to the pixel, and the rest cell by cell."""
    curves, lengths = (landscape.first, landscape.second), (landscape.rows, landscape.columns)
    one, other = (curve.within(s) for curve, s in zip(curves, lengths, strict=True))
    blocked = one[:, None] & other & ~landscape.allowed
    fine = []
    for curve, s, factor in zip(curves, lengths, times, strict=True):
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
    """A finer grid of equal pixels within each cell."""
    return np.repeat(np.repeat(cells, times[0], axis=0), times[1], axis=1)


def _lines(part: Array, bands: int) -> Mask:
    """Pixels between one band of values and the next."""
    band = np.floor(part * bands)
    lines = np.zeros(part.shape, dtype=bool)
    lines[:-1] |= band[:-1] != band[1:]
    lines[:, :-1] |= band[:, :-1] != band[:, 1:]
    return lines


def _axes(frame: PlotFrame, look: MapLook) -> Iterator[str]:
    """Axes with their ticks."""
    for value, said in ticks(*frame.x, look.ticks):
        x = frame.across(value)
        yield f'<path d="M{x:.1f} {frame.bottom:.1f}v3" stroke="currentColor"/>'
        yield text(x, frame.bottom + 12, said, "middle")
    for value, said in ticks(*frame.y, look.ticks):
        y = frame.down(value)
        yield f'<path d="M{frame.left:.1f} {y:.1f}h-3" stroke="currentColor"/>'
        yield text(frame.left - 5, y + 3, said, "end")
    yield frame.rectangle('fill="none" stroke="currentColor" stroke-opacity="0.5"')


def _bar(frame: PlotFrame, low: float, high: float, unit: str, look: MapLook) -> Iterator[str]:
    """The bar that tells values by their colours."""
    left = frame.right + 7
    bar = PlotFrame(left, frame.top, look.bar, frame.height, (0, 1), (low, high))
    yield from color_bar("bar", bar, look.colours)
    for value, said in ticks(low, high, look.ticks):
        yield text(left + look.bar + 3, bar.down(value) + 3, said)
    yield text(frame.right + 7, frame.bottom + 12, unit if unit != "1" else "")
