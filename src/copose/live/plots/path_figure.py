"""Drawings of motions along time: the objective, limits and joints, under one cursor."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from copose.live.plots.svg import PLOT, PlotFrame, drawing, levels, runs, text, ticks
from copose.poses import Array
from copose.report.joint_curves import JointCurves, limit_shares, spread
from copose.report.look import LOOK
from copose.report.words import failure_words, percent, short, three, titled_objective
from copose.results import Motion


@dataclass(frozen=True)
class MotionPlotLook:
    """Sizes, px, and colours of the drawing of a motion along time."""

    left: float = 38.0  # margins of the charts; numbers of joints stand at the right
    right: float = 14.0
    values: float = 105.0  # height of the chart of values
    limits: float = 80.0  # height of the chart of limits
    joints: float = 105.0  # height of a chart of joints
    line: float = 13.0  # height of a line of words above a chart
    apart: float = 12.0  # between a chart and the next
    foot: float = 28.0  # below the last chart: numbers and words along time
    up: int = 4  # ticks upwards, at most
    along: int = 5  # ticks along time, at most
    free: float = 0.08  # free space above and below the values, of their span
    numbers: float = 9.5  # between the numbers of two joints, at least
    tracking: str = "#8C8C8C"  # least-norm tracking
    speed: str = PLOT.curve  # shares of limits, by their kinds
    acceleration: str = PLOT.others[2]
    torque: str = PLOT.others[1]
    joint_colours: tuple[str, ...] = (PLOT.curve, *PLOT.others)
    # Custom property of the page with the place of the cursor, as a share of the duration.
    cursor: str = "--copose-time"


@dataclass(frozen=True, eq=False)
class _Chart:
    """A chart of the column."""

    title: str  # above it
    height: float  # of its frame, px
    y: tuple[float, float]  # numbers at its lower and upper edge
    # Times, values, colour and further attributes of each curve.
    lines: tuple[tuple[Array, Array, str, str], ...]
    keys: tuple[tuple[str, str], ...] = ()  # colours and words of a line below the title each
    limits: tuple[float, ...] = ()  # numbers that are drawn as limits
    ends: bool = False  # numbers of joints beside the right ends of the lines

    def whole(self, look: MotionPlotLook) -> float:
        """Height with the words above and the free space below, px."""
        return self.height + look.line * (1 + len(self.keys)) + look.apart


def motion_svg(
    motion: Motion, *, width: float = 300.0, look: MotionPlotLook = MotionPlotLook()
) -> str:
    """The charts of ``path.png``, one below the other, with a cursor through all of them, which
    `cursor_style` puts at an instant.
    """
    assert motion.time is not None
    time = np.array(motion.time)
    span = (float(time[0]), float(time[-1] if time[-1] > time[0] else time[0] + 1.0))
    charts = [_values(motion, time, look), *_limits(motion, look)]
    charts += [_joints(motion, time, arm, look) for arm in motion.joint_names]
    parts: list[str] = []
    top = 0.0
    for chart in charts:
        whole = chart.whole(look)
        frame = PlotFrame(look.left, top + whole - chart.height - look.apart,
                      width - look.left - look.right, chart.height, span, chart.y)  # fmt: skip
        parts += _drawn(chart, frame, top, look)
        top += whole
    bottom = top - look.apart
    for value, said in ticks(*span, look.along):
        parts.append(text(frame.across(value), bottom + 12, said, "middle"))
    parts.append(text((frame.left + frame.right) / 2, bottom + 24, "time, s", "middle"))
    parts.append(
        f'<line x1="{look.left:g}" x2="{look.left:g}" y1="{look.line:g}" y2="{bottom:.1f}" '
        f'stroke="{PLOT.present}" stroke-width="1.4" class="copose-cursor" '
        f'style="transform: translateX(calc(var({look.cursor}, 0) * {frame.width:.1f}px))"/>'
    )
    return drawing(width, bottom + look.foot, parts, "the motion along time")


def _values(motion: Motion, time: Array, look: MotionPlotLook) -> _Chart:
    """The objective of the motion and of least-norm tracking."""
    assert motion.knots is not None
    after = np.array([knot.objective for knot in motion.knots], dtype=float)
    lines = [(time, after, LOOK.system, 'stroke-width="2.4"')]
    words = f"planned: {motion.aggregate} {three(motion.objective.after)}"
    keys = [(LOOK.system, words)]
    tracking = motion.least_norm
    if tracking is not None:
        before = np.array(tracking.objective, dtype=float)
        lines.insert(0, (time, before, look.tracking, 'stroke-width="1.8"'))
        words = f"{motion.aggregate} {three(motion.objective.before)}"
        if tracking.reason is not None:
            words = f"fails {failure_words(motion)}"
        keys.append((look.tracking, f"least-norm tracking: {words}"))
    y = _span([values for _, values, *_ in lines], look.free)
    return _Chart(titled_objective(motion), look.values, y, tuple(lines), tuple(keys))


def _limits(motion: Motion, look: MotionPlotLook) -> Iterator[_Chart]:
    """The largest share of each kind of limit, in percent."""
    shares = limit_shares(motion)
    if not shares:
        return
    lines = tuple(
        (share.time, 100 * share.values, getattr(look, share.kind), 'stroke-width="1.8"')
        for share in shares
    )
    keys = tuple(
        (getattr(look, share.kind), f"{share.kind}: up to {percent(share.largest[0])} %")
        for share in shares
    )
    top = 1.1 * max(100.0, *(100 * share.largest[0] for share in shares))
    title = "share of limits, the largest of all joints, %"
    yield _Chart(title, look.limits, (0.0, top), lines, keys, limits=(100.0,))


def _joints(motion: Motion, time: Array, arm: str, look: MotionPlotLook) -> _Chart:
    """The joints of an arm between their limits."""
    curves = JointCurves.of(motion, arm)
    lines = []
    for i, bounded in enumerate(curves.bounded):
        dashes = "" if bounded or not curves.limited else ' stroke-dasharray="4 3"'
        colour = look.joint_colours[i % len(look.joint_colours)]
        lines.append((time, curves.values[:, i], colour, f'stroke-width="1.6"{dashes}'))
    y = _span(list(curves.values.T), look.free)
    limits: tuple[float, ...] = ()
    if curves.limited:
        y, limits = (-curves.furthest, curves.furthest), (-1.0, 1.0)
    title = f"joints of arm {short(arm)}: {curves.unit}"
    return _Chart(title, look.joints, y, tuple(lines), limits=limits, ends=True)


def _span(lines: Sequence[Array], share: float) -> tuple[float, float]:
    """The range of values that is drawn, with a share of it free at both ends."""
    every = np.concatenate(lines)
    every = every[np.isfinite(every)]
    if not len(every):
        return 0.0, 1.0
    low, high = float(every.min()), float(every.max())
    free = share * (high - low) or max(1e-9, abs(high) * 1e-3)
    return low - free, high + free


def _drawn(chart: _Chart, frame: PlotFrame, top: float, look: MotionPlotLook) -> Iterator[str]:
    """The words, axes and curves of a chart."""
    yield text(2, top + 11, chart.title, more=f'font-size="{PLOT.letters}" font-weight="600"')
    for k, (colour, words) in enumerate(chart.keys):
        y = top + 11 + look.line * (k + 1)
        yield f'<path d="M4 {y - 3:.1f}h14" stroke="{colour}" stroke-width="2.4"/>'
        yield text(22, y, words)
    yield from levels(frame, ticks(*chart.y, look.up))
    for value, _ in ticks(*frame.x, look.along):
        x = frame.across(value)
        yield (f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{frame.top:.1f}" y2="{frame.bottom:.1f}" '
               'stroke="currentColor" stroke-opacity="0.13"/>')  # fmt: skip
    for value in chart.limits:
        y = frame.down(value)
        yield (f'<line x1="{frame.left:.1f}" x2="{frame.right:.1f}" y1="{y:.1f}" y2="{y:.1f}" '
               f'stroke="{PLOT.touching}" stroke-dasharray="4 3"/>')  # fmt: skip
    for time, values, colour, attributes in chart.lines:
        for known in runs(np.isfinite(values)):
            yield frame.line(time[known], values[known],
                             f'stroke="{colour}" {attributes} stroke-linejoin="round"')  # fmt: skip
    yield frame.rectangle('fill="none" stroke="currentColor" stroke-opacity="0.4"')
    if chart.ends:
        yield from _numbers(chart, frame, look.numbers)


def _numbers(chart: _Chart, frame: PlotFrame, apart: float) -> Iterator[str]:
    """The numbers of joints, from root to tip, beside the right ends of their lines."""
    heights = np.array([frame.down(values[-1]) for _, values, *_ in chart.lines])
    order = np.argsort(heights, kind="stable")
    for y, i in zip(spread(heights[order], apart), order, strict=True):
        colour = chart.lines[i][2]
        yield text(frame.right + 4, y + 3, str(i + 1), more=f'fill="{colour}" font-weight="700"')


def cursor_style(share: float) -> str:
    """A style sheet that puts the cursor at a share of the duration."""
    return f"<style>:root {{ {MotionPlotLook.cursor}: {share:.5f} }}</style>"
