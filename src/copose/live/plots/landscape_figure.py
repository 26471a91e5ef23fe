"""The objective over an arm's self-motion as a drawing, with limits and other self-motions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import takewhile

import numpy as np

from copose.live.plots.svg import (
    PLOT,
    PlotFrame,
    dot,
    drawing,
    hatch,
    legend,
    levels,
    runs,
    star,
    text,
    ticks,
    upright,
    width_of,
)
from copose.self_motion.curves.self_motion_curve import SelfMotionCurve


@dataclass(frozen=True)
class CurveLook:
    """Sizes of the drawing of a self-motion."""

    top: float = 20.0  # margins, px
    right: float = 4.0
    bottom: float = 30.0
    other_width: float = 34.0  # width of another self-motion beside the curve, px
    apart: float = 7.0  # free space before it, px
    most_others: float = 0.4  # part of the width that others take at most
    below: float = 0.1  # free space below the allowed values, of their span
    above: float = 0.22  # free space above them
    fallen: float = 0.03  # part of the values that may lie lower: near singularities all fall
    name: float = 11.0  # width of a joint's name beside a cut, px
    ticks: int = 4  # ticks of an axis, at most


def curve_svg(
    curve: SelfMotionCurve,
    *,
    present: float | None = None,
    value: float | None = None,
    width: float = 300.0,
    height: float = 170.0,
    look: CurveLook = CurveLook(),
) -> str:
    """The objective along a self-motion: dashed beyond limits, whose joints are named where they
    cut it, and red where something touches or torques do not hold; the present posture, the best
    one, and the arm's other self-motions beside it on the same scale.

    Args:
        curve: the self-motion that the arm is on.
        present: arc length at the posture of the arm, in place of the curve's.
        value: of the objective there; without it what is between the curve's knots.
        width: width of the drawing, px.
        height: height of the drawing, px.
        look: sizes.
    """
    present = curve.present if present is None else present
    if present is not None:
        present = float(np.clip(present, *_wide(curve.window)))
    other_curves = [other for other in curve.others if other.best is not None]
    other_curves = other_curves[: int(look.most_others * width / (look.other_width + look.apart))]
    y = _value_range([curve, *other_curves], look)
    marks = ticks(*y, look.ticks)
    left = max(width_of(said) for _, said in marks) + 8
    room = len(other_curves) * (look.other_width + look.apart)
    frame = PlotFrame(left, look.top, width - left - room - look.right,
                  height - look.top - look.bottom, _wide(curve.window), y)  # fmt: skip
    now = _value_at(curve, present) if value is None else value
    if value is None and present == curve.present:
        now = curve.value
    best = curve.best
    parts = [_patterns(curve.arm), *_axes(frame, marks, look)]
    parts += [legend(left, 13, now, None if best is None else best[1], curve.unit,
                     curve.estimated)]  # fmt: skip
    parts += [*_zones(frame, curve, look), *_branch(frame, curve, PLOT.curve, 2.2)]
    parts += _cuts(frame, curve, look)
    if present is not None:
        x = frame.across(present)
        parts.append(f'<path d="M{x:.1f} {frame.top:.1f}V{frame.bottom:.1f}" '
                     'stroke="currentColor" stroke-opacity="0.55"/>')  # fmt: skip
    if best is not None:
        parts.append(star(frame.across(best[0]), frame.down(best[1]), 7.0))
    if present is not None and now is not None:
        parts.append(dot(frame.across(present), frame.down(float(np.clip(now, *y))), 3.8))
    parts += _other_plots(frame, other_curves, look)
    said = f"{curve.arm}: along its self-motion, {curve.unit_of_length}"
    parts.append(text((frame.left + frame.right) / 2, height - 3, said, "middle"))
    return drawing(width, height, parts, f"objective along the self-motion of {curve.arm}")


def short_name(names: Sequence[str], joint: int) -> str:
    """The name of a joint without what all of an arm's have in common."""
    name, columns = names[joint], zip(*names, strict=False)
    alike = sum(1 for _ in takewhile(lambda letters: len(set(letters)) == 1, columns))
    tail = name[alike:] if len(names) > 1 else name
    tail = tail.removesuffix("_joint").strip("_-. ")
    return f"joint {tail}" if tail.isdigit() else tail or name


def _value_range(curves: Sequence[SelfMotionCurve], look: CurveLook) -> tuple[float, float]:
    """The range of values that is drawn."""
    allowed = [curve.objective[curve.allowed] for curve in curves]
    every = np.concatenate(allowed)
    if not len(every):
        every = np.concatenate([c.objective[np.isfinite(c.objective)] for c in curves])
    if not len(every):
        return 0.0, 1.0
    high = float(every.max())
    low = min(float(np.quantile(every, look.fallen)), high)
    low = float(every.min()) if high - every.min() < 2 * (high - low) else low
    span = high - low if high > low else max(1e-9, abs(high) * 1e-3)
    return low - look.below * span, high + look.above * span


def _wide(window: tuple[float, float]) -> tuple[float, float]:
    """A window of arc lengths, widened where it is a point."""
    low, high = window
    return (low, high) if high > low else (low - 0.5, low + 0.5)


def _value_at(curve: SelfMotionCurve, s: float | None) -> float | None:
    """The objective at an arc length; None where there is none."""
    if s is None:
        return None
    value = float(np.interp(curve.track.kept(s), curve.positions, curve.objective))
    return value if np.isfinite(value) else None


def _patterns(arm: str) -> str:
    """Patterns that fill what limits, bodies or torques forbid."""
    key = _key(arm)
    lines = hatch(f"out-{key}", "currentColor", 0.16) + hatch(f"hit-{key}", PLOT.touching, 0.35)
    return f"<defs>{lines}</defs>"


def _key(arm: str) -> str:
    """A name for patterns: several drawings may be on one page."""
    return arm.encode().hex()


def _axes(frame: PlotFrame, marks: Sequence[tuple[float, str]], look: CurveLook) -> Iterator[str]:
    """Axes with their ticks."""
    yield from levels(frame, marks)
    for value, said in ticks(*frame.x, look.ticks):
        x = frame.across(value)
        yield (f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{frame.bottom:.1f}" '
               f'y2="{frame.bottom + 3:.1f}" stroke="currentColor"/>')  # fmt: skip
        yield text(x, frame.bottom + 12, said, "middle")
    yield frame.rectangle('fill="none" stroke="currentColor" stroke-opacity="0.5"')


def _zones(frame: PlotFrame, curve: SelfMotionCurve, look: CurveLook) -> Iterator[str]:
    """Hatched bands beyond limits, and marks where something touches or torques do not hold."""
    ends = [frame.x[0], *(end for piece in curve.pieces for end in piece), frame.x[1]]
    zones = [("", low, high) for low, high in zip(ends[::2], ends[1::2], strict=True)]
    s, inside, clear = curve.positions, curve.inside, curve.clear
    # A zone ends half the way between two knots.
    edges = np.concatenate([s[:1], (s[1:] + s[:-1]) / 2, s[-1:]])
    touching, overloaded = inside & ~clear, inside & clear & ~curve.held
    zones += [("touches", edges[run.start], edges[run.stop]) for run in runs(touching)]
    zones += [("torques", edges[run.start], edges[run.stop]) for run in runs(overloaded)]
    for what, low, high in zones:
        kind = "hit" if what else "out"
        low, high = max(low, frame.x[0]), min(high, frame.x[1])
        if high > low:
            a, b = frame.across(low), frame.across(high)
            zone = PlotFrame(a, frame.top, b - a, frame.height, (0, 1), (0, 1))
            yield zone.rectangle(f'fill="url(#{kind}-{_key(curve.arm)})"')
            if what and b - a > look.name:
                colour = f'fill="{PLOT.touching}"'
                yield upright((a + b) / 2 + 3, frame.bottom - 4, what, more=colour)


def _branch(frame: PlotFrame, curve: SelfMotionCurve, colour: str, stroke: float) -> Iterator[str]:
    """The values along a self-motion, as far as they are within the frame."""
    low, high = frame.y
    s, values = curve.positions, curve.objective
    shown = np.isfinite(values) & (s >= frame.x[0]) & (s <= frame.x[1])
    shown &= (values >= low) & (values <= high)
    inside = curve.inside & curve.clear & curve.held
    rest = 'stroke="currentColor" stroke-opacity="0.55" stroke-width="1.2" stroke-dasharray="3 3"'
    for kind, look in ((~inside, rest), (inside, f'stroke="{colour}" stroke-width="{stroke:g}"')):
        for run in runs(kind & shown):
            rows = run if kind is inside else slice(max(run.start - 1, 0), run.stop + 1)
            line, at = values[rows], s[rows]
            keep = np.isfinite(line) & (line >= low) & (line <= high)
            yield frame.line(at[keep], line[keep], f'{look} stroke-linejoin="round"')


def _cuts(frame: PlotFrame, curve: SelfMotionCurve, look: CurveLook) -> Iterator[str]:
    """Lines where limits cut, with the names of their joints on the side beyond."""
    taken: list[float] = []
    for cut in curve.cuts:
        x = frame.across(cut.position)
        if not frame.left <= x <= frame.right:
            continue
        yield (f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{frame.top:.1f}" y2="{frame.bottom:.1f}" '
               'stroke="currentColor" stroke-opacity="0.6" stroke-dasharray="2 2"/>')  # fmt: skip
        place = x - 3 if cut.entering else x + look.name - 2
        if place - look.name + 2 < frame.left:
            place = x + look.name - 2
        if place > frame.right - 1:
            place = x - 3
        if any(abs(place - other) < look.name - 1 for other in taken):
            continue
        taken.append(place)
        end = "max" if cut.upper else "min"
        said = f"{short_name(curve.joint_names, cut.joint)} {end}"
        yield upright(place, frame.top + 4, said, "end", 'fill-opacity="0.85"')


def _other_plots(
    frame: PlotFrame, curves: Sequence[SelfMotionCurve], look: CurveLook
) -> Iterator[str]:
    """Other self-motions on the same scale of values, small."""
    left = frame.right + look.apart
    for k, other in enumerate(curves):
        colour = PLOT.others[other.branch % len(PLOT.others)]
        small = PlotFrame(
            left, frame.top, look.other_width, frame.height, _wide(other.window), frame.y
        )
        yield small.rectangle('fill="none" stroke="currentColor" stroke-opacity="0.25"')
        yield from _branch(small, other, colour, 1.6)
        if other.best is not None:
            s, value = other.best
            value = float(np.clip(value, *frame.y))
            yield star(small.across(s), small.down(value), 5.0, colour)
        if k == 0:
            said = "others" if len(curves) > 1 else "other"
            middle = left + (len(curves) * (look.other_width + look.apart) - look.apart) / 2
            yield text(middle, frame.bottom + 12, said, "middle")
        left += look.other_width + look.apart
