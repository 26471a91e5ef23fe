"""The objective, limits and joints of a motion along time, as one drawing under a cursor."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from copose.live.plots.svg import (
    CURVE,
    LETTERS,
    OTHERS,
    PRESENT,
    TOUCHING,
    Frame,
    drawing,
    text,
    ticks,
)
from copose.poses import Array
from copose.report.joint_curves import JointCurves, spread
from copose.report.limit_use import limit_shares
from copose.report.look import LOOK
from copose.report.numbers import percent, three
from copose.report.words import failure_words, objective_name, objective_unit, short
from copose.results import Motion

# Margins left and right of the charts, px; numbers of joints stand at the right.
_LEFT = 38.0
_RIGHT = 14.0
# Height of a chart of values, of limits and of joints, px.
_VALUES = 105.0
_LIMITS = 80.0
_JOINTS = 105.0
# Height of a line of words above a chart, and between a chart and the next, px.
_LINE = 13.0
_APART = 12.0
# Below the last chart, px: numbers and words along time.
_FOOT = 28.0
# Ticks at most, up and along.
_UP = 4
_ALONG = 5
# What is free above and below the values, of their span.
_FREE = 0.08
# What the numbers of two joints are apart at least, px.
_NUMBERS_APART = 9.5
# Colours of what planning is compared with, and of shares of limits.
_TRACKING = "#8C8C8C"
_SHARES = {"speed": CURVE, "acceleration": OTHERS[2], "torque": OTHERS[1]}
_JOINT_COLOURS = (CURVE, *OTHERS)
# The custom property of the page that says where the cursor is: the share of the duration.
CURSOR = "--copose-time"


@dataclass(frozen=True, eq=False)
class _Chart:
    """A chart of the column.

    Attributes:
        title: above it.
        height: of its frame, px.
        y: numbers at its lower and upper edge.
        keys: colours and words of a line below the title each.
        lines: times, values, colour and further attributes of each curve.
        limits: numbers that are drawn as limits.
        ends: numbers of joints beside the right ends of the lines.
    """

    title: str
    height: float
    y: tuple[float, float]
    lines: tuple[tuple[Array, Array, str, str], ...]
    keys: tuple[tuple[str, str], ...] = ()
    limits: tuple[float, ...] = ()
    ends: bool = False

    @property
    def whole(self) -> float:
        """Height with the words above and what is free below, px."""
        return self.height + _LINE * (1 + len(self.keys)) + _APART


def motion_svg(motion: Motion, *, width: float = 300.0) -> str:
    """The curves of ``path.png``, one below the other, with a line through all of them at the share
    of the duration that the custom property `CURSOR` says.

    Args:
        motion: with knots.
        width: of the drawing, px.
    """
    assert motion.time is not None
    time = np.array(motion.time)
    span = (float(time[0]), float(time[-1] if time[-1] > time[0] else time[0] + 1.0))
    charts = [_values(motion, time), *_limits(motion)]
    charts += [_joints(motion, time, arm) for arm in motion.joint_names]
    parts, top = [], 0.0
    for chart in charts:
        frame = Frame(_LEFT, top + chart.whole - chart.height - _APART, width - _LEFT - _RIGHT,
                      chart.height, span, chart.y)  # fmt: skip
        parts += [*_drawn(chart, frame, top)]
        top += chart.whole
    bottom = top - _APART
    for value, said in ticks(*span, _ALONG):
        parts.append(text(frame.across(value), bottom + 12, said, "middle"))
    parts.append(text((frame.left + frame.right) / 2, bottom + 24, "time, s", "middle"))
    parts.append(
        f'<line x1="{_LEFT:g}" x2="{_LEFT:g}" y1="{_LINE:g}" y2="{bottom:.1f}" stroke="{PRESENT}" '
        f'stroke-width="1.4" class="copose-cursor" '
        f'style="transform: translateX(calc(var({CURSOR}, 0) * {frame.width:.1f}px))"/>'
    )
    return drawing(width, bottom + _FOOT, parts, "the motion along time")


def _values(motion: Motion, time: Array) -> _Chart:
    """The objective of the motion and of least-norm tracking."""
    assert motion.knots is not None
    after = np.array([knot.objective for knot in motion.knots], dtype=float)
    lines = [(time, after, LOOK.system, 'stroke-width="2.4"')]
    words = f"planned: {motion.aggregate} {three(motion.objective.after)}"
    keys = [(LOOK.system, words)]
    tracking = motion.least_norm
    if tracking is not None:
        before = np.array(tracking.objective, dtype=float)
        lines.insert(0, (time, before, _TRACKING, 'stroke-width="1.8"'))
        words = f"{motion.aggregate} {three(motion.objective.before)}"
        if tracking.reason is not None:
            words = f"fails {failure_words(motion)}"
        keys.append((_TRACKING, f"least-norm tracking: {words}"))
    unit = objective_unit(motion)
    title = ", ".join(filter(None, (objective_name(motion), unit)))
    y = _span([values for _, values, *_ in lines])
    return _Chart(title, _VALUES, y, tuple(lines), tuple(keys))


def _limits(motion: Motion) -> Iterator[_Chart]:
    """The largest share of each kind of limit, in percent."""
    shares = limit_shares(motion)
    if not shares:
        return
    lines = tuple(
        (each.time, 100 * each.values, _SHARES[each.kind], 'stroke-width="1.8"') for each in shares
    )
    keys = tuple(
        (_SHARES[each.kind], f"{each.kind}: up to {percent(each.largest[0])} %") for each in shares
    )
    top = 1.1 * max(100.0, *(100 * each.largest[0] for each in shares))
    title = "share of limits, the largest of all joints, %"
    yield _Chart(title, _LIMITS, (0.0, top), lines, keys, limits=(100.0,))


def _joints(motion: Motion, time: Array, arm: str) -> _Chart:
    """The joints of an arm between their limits."""
    curves = JointCurves.of(motion, arm)
    lines = []
    for i, bounded in enumerate(curves.bounded):
        dashes = "" if bounded or not curves.limited else ' stroke-dasharray="4 3"'
        colour = _JOINT_COLOURS[i % len(_JOINT_COLOURS)]
        lines.append((time, curves.values[:, i], colour, f'stroke-width="1.6"{dashes}'))
    y = _span(list(curves.values.T))
    limits: tuple[float, ...] = ()
    if curves.limited:
        y, limits = (-curves.furthest, curves.furthest), (-1.0, 1.0)
    title = f"joints of arm {short(arm)}: {curves.unit}"
    return _Chart(title, _JOINTS, y, tuple(lines), limits=limits, ends=True)


def _span(lines: Sequence[Array]) -> tuple[float, float]:
    """From which value to which is drawn."""
    every = np.concatenate(lines)
    every = every[np.isfinite(every)]
    if not len(every):
        return 0.0, 1.0
    low, high = float(every.min()), float(every.max())
    free = _FREE * (high - low) or max(1e-9, abs(high) * 1e-3)
    return low - free, high + free


def _drawn(chart: _Chart, frame: Frame, top: float) -> Iterator[str]:
    """Words, axes and curves."""
    yield text(2, top + 11, chart.title, more=f'font-size="{LETTERS}" font-weight="600"')
    for k, (colour, words) in enumerate(chart.keys):
        y = top + 11 + _LINE * (k + 1)
        yield f'<path d="M4 {y - 3:.1f}h14" stroke="{colour}" stroke-width="2.4"/>'
        yield text(22, y, words)
    for value, said in ticks(*chart.y, _UP):
        y = frame.down(value)
        yield (f'<line x1="{frame.left:.1f}" x2="{frame.right:.1f}" y1="{y:.1f}" y2="{y:.1f}" '
               'stroke="currentColor" stroke-opacity="0.13"/>')  # fmt: skip
        yield text(frame.left - 4, y + 3, said, "end")
    for value, _ in ticks(*frame.x, _ALONG):
        x = frame.across(value)
        yield (f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{frame.top:.1f}" y2="{frame.bottom:.1f}" '
               'stroke="currentColor" stroke-opacity="0.13"/>')  # fmt: skip
    for value in chart.limits:
        y = frame.down(value)
        yield (f'<line x1="{frame.left:.1f}" x2="{frame.right:.1f}" y1="{y:.1f}" y2="{y:.1f}" '
               f'stroke="{TOUCHING}" stroke-dasharray="4 3"/>')  # fmt: skip
    for time, values, colour, look in chart.lines:
        for known in _pieces(values):
            yield frame.line(time[known], values[known],
                             f'stroke="{colour}" {look} stroke-linejoin="round"')  # fmt: skip
    yield frame.rectangle('fill="none" stroke="currentColor" stroke-opacity="0.4"')
    if chart.ends:
        yield from _numbers(chart, frame)


def _pieces(values: Array) -> Iterator[slice]:
    """Runs of finite numbers."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.isfinite(values), [0]]).astype(int)))
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        yield slice(int(first), int(end))


def _numbers(chart: _Chart, frame: Frame) -> Iterator[str]:
    """The numbers of joints, from root to tip, beside the right ends of their lines."""
    heights = np.array([frame.down(values[-1]) for _, values, *_ in chart.lines])
    order = np.argsort(heights, kind="stable")
    for y, i in zip(spread(heights[order], _NUMBERS_APART), order, strict=True):
        colour = chart.lines[i][2]
        yield text(frame.right + 4, y + 3, str(i + 1), more=f'fill="{colour}" font-weight="700"')


def cursor_style(share: float) -> str:
    """A style sheet that puts the cursor at a share of the duration."""
    return f"<style>:root {{ {CURSOR}: {share:.5f} }}</style>"
