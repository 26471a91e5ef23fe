"""The objective over an arm's self-motion as a drawing, with limits and other self-motions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import takewhile

import numpy as np

from copose.live.plots.svg import (
    CURVE,
    OTHERS,
    TOUCHING,
    Frame,
    dot,
    drawing,
    hatch,
    legend,
    star,
    text,
    ticks,
    upright,
    width_of,
)
from copose.poses import Mask
from copose.self_motion.curves.self_motion_curve import SelfMotionCurve

# Margins of the drawing, px.
_TOP = 20.0
_RIGHT = 4.0
_BOTTOM = 30.0
# Of another self-motion beside the curve, px: its width, and what is free before it.
_BESIDE = 34.0
_APART = 7.0
# Others are drawn up to this part of the width.
_MOST_BESIDE = 0.4
# What is drawn below and above the values that are allowed, of their span; and the part of them
# that may lie below: near singular postures they fall to −∞.
_BELOW = 0.1
_ABOVE = 0.22
_FALLEN = 0.03
# Room that a joint's name takes beside a cut, px.
_NAMED = 11.0
# Ticks at most.
_TICKS = 4


def curve_svg(
    curve: SelfMotionCurve,
    *,
    present: float | None = None,
    value: float | None = None,
    width: float = 300.0,
    height: float = 170.0,
) -> str:
    """The objective along a self-motion: dashed beyond limits, whose joints are named where they
    cut it, and red where something touches or torques do not hold; the present posture, the best
    one, and the arm's other self-motions beside it on the same scale.

    Args:
        curve: the self-motion that the arm is on.
        present: arc length at the posture of the arm, in place of the curve's.
        value: of the objective there; without it what is between the curve's knots.
        width: of the drawing, px; `height` alike.
        height: px.
    """
    present = curve.present if present is None else present
    if present is not None:
        present = float(np.clip(present, *_wide(curve.window)))
    others = [other for other in curve.others if other.best is not None]
    others = others[: int(_MOST_BESIDE * width / (_BESIDE + _APART))]
    y = _value_range([curve, *others])
    marks = ticks(*y, _TICKS)
    left = max(width_of(said) for _, said in marks) + 8
    beside = len(others) * (_BESIDE + _APART)
    frame = Frame(left, _TOP, width - left - beside - _RIGHT, height - _TOP - _BOTTOM,
                  _wide(curve.window), y)  # fmt: skip
    now = _value_at(curve, present) if value is None else value
    if value is None and present == curve.present:
        now = curve.value
    best = curve.best
    parts = [_patterns(curve.arm), *_axes(frame, marks)]
    parts += [legend(left, 13, now, None if best is None else best[1], curve.unit,
                     curve.estimated)]  # fmt: skip
    parts += [*_zones(frame, curve), *_branch(frame, curve, CURVE, 2.2), *_cuts(frame, curve)]
    if present is not None:
        x = frame.across(present)
        parts.append(f'<path d="M{x:.1f} {frame.top:.1f}V{frame.bottom:.1f}" '
                     'stroke="currentColor" stroke-opacity="0.55"/>')  # fmt: skip
    if best is not None:
        parts.append(star(frame.across(best[0]), frame.down(best[1]), 7.0))
    if present is not None and now is not None:
        parts.append(dot(frame.across(present), frame.down(float(np.clip(now, *y))), 3.8))
    parts += _beside(frame, others, width)
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


def _value_range(curves: Sequence[SelfMotionCurve]) -> tuple[float, float]:
    """From which value to which is drawn."""
    allowed = [curve.objective[curve.allowed] for curve in curves]
    every = np.concatenate(allowed)
    if not len(every):
        every = np.concatenate([c.objective[np.isfinite(c.objective)] for c in curves])
    if not len(every):
        return 0.0, 1.0
    high = float(every.max())
    low = min(float(np.quantile(every, _FALLEN)), high)
    low = float(every.min()) if high - every.min() < 2 * (high - low) else low
    span = high - low if high > low else max(1e-9, abs(high) * 1e-3)
    return low - _BELOW * span, high + _ABOVE * span


def _wide(window: tuple[float, float]) -> tuple[float, float]:
    low, high = window
    return (low, high) if high > low else (low - 0.5, low + 0.5)


def _value_at(curve: SelfMotionCurve, s: float | None) -> float | None:
    if s is None:
        return None
    value = float(np.interp(curve.track.kept(s), curve.positions, curve.objective))
    return value if np.isfinite(value) else None


def _patterns(arm: str) -> str:
    key = _key(arm)
    lines = hatch(f"out-{key}", "currentColor", 0.16) + hatch(f"hit-{key}", TOUCHING, 0.35)
    return f"<defs>{lines}</defs>"


def _key(arm: str) -> str:
    """A name for patterns: several drawings may be on one page."""
    return arm.encode().hex()


def _axes(frame: Frame, marks: Sequence[tuple[float, str]]) -> Iterator[str]:
    for value, said in marks:
        y = frame.down(value)
        yield (f'<line x1="{frame.left:.1f}" x2="{frame.right:.1f}" y1="{y:.1f}" y2="{y:.1f}" '
               'stroke="currentColor" stroke-opacity="0.13"/>')  # fmt: skip
        yield text(frame.left - 4, y + 3, said, "end")
    for value, said in ticks(*frame.x, _TICKS):
        x = frame.across(value)
        yield (f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{frame.bottom:.1f}" '
               f'y2="{frame.bottom + 3:.1f}" stroke="currentColor"/>')  # fmt: skip
        yield text(x, frame.bottom + 12, said, "middle")
    yield frame.rectangle('fill="none" stroke="currentColor" stroke-opacity="0.5"')


def _runs(mask: Mask) -> list[tuple[int, int]]:
    """First and last row of each run of what is marked."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _zones(frame: Frame, curve: SelfMotionCurve) -> Iterator[str]:
    """Hatched bands beyond limits, and marks where something touches or torques do not hold."""
    ends = [frame.x[0], *(end for piece in curve.pieces for end in piece), frame.x[1]]
    zones = [("", low, high) for low, high in zip(ends[::2], ends[1::2], strict=True)]
    s, inside, clear = curve.positions, curve.inside, curve.clear
    # What is so at a knot is so half the way to the next.
    edges = np.concatenate([s[:1], (s[1:] + s[:-1]) / 2, s[-1:]])
    zones += [("touches", edges[a], edges[b + 1]) for a, b in _runs(inside & ~clear)]
    zones += [("torques", edges[a], edges[b + 1]) for a, b in _runs(inside & clear & ~curve.held)]
    for what, low, high in zones:
        kind = "hit" if what else "out"
        low, high = max(low, frame.x[0]), min(high, frame.x[1])
        if high > low:
            a, b = frame.across(low), frame.across(high)
            zone = Frame(a, frame.top, b - a, frame.height, (0, 1), (0, 1))
            yield zone.rectangle(f'fill="url(#{kind}-{_key(curve.arm)})"')
            if what and b - a > _NAMED:
                look = f'fill="{TOUCHING}"'
                yield upright((a + b) / 2 + 3, frame.bottom - 4, what, more=look)


def _branch(frame: Frame, curve: SelfMotionCurve, colour: str, stroke: float) -> Iterator[str]:
    """The values along a self-motion, as far as they are within the frame."""
    low, high = frame.y
    s, values = curve.positions, curve.objective
    shown = np.isfinite(values) & (s >= frame.x[0]) & (s <= frame.x[1])
    shown &= (values >= low) & (values <= high)
    inside = curve.inside & curve.clear & curve.held
    rest = 'stroke="currentColor" stroke-opacity="0.55" stroke-width="1.2" stroke-dasharray="3 3"'
    for kind, look in ((~inside, rest), (inside, f'stroke="{colour}" stroke-width="{stroke:g}"')):
        for a, b in _runs(kind & shown):
            rows = slice(max(a - 1, 0), b + 2) if kind is not inside else slice(a, b + 1)
            line, at = values[rows], s[rows]
            keep = np.isfinite(line) & (line >= low) & (line <= high)
            yield frame.line(at[keep], line[keep], f'{look} stroke-linejoin="round"')


def _cuts(frame: Frame, curve: SelfMotionCurve) -> Iterator[str]:
    """Lines where limits cut, with the names of their joints on the side beyond."""
    taken: list[float] = []
    for cut in curve.cuts:
        x = frame.across(cut.position)
        if not frame.left <= x <= frame.right:
            continue
        yield (f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{frame.top:.1f}" y2="{frame.bottom:.1f}" '
               'stroke="currentColor" stroke-opacity="0.6" stroke-dasharray="2 2"/>')  # fmt: skip
        place = x - 3 if cut.entering else x + _NAMED - 2
        if place - _NAMED + 2 < frame.left:
            place = x + _NAMED - 2
        if place > frame.right - 1:
            place = x - 3
        if any(abs(place - other) < _NAMED - 1 for other in taken):
            continue
        taken.append(place)
        end = "max" if cut.upper else "min"
        said = f"{short_name(curve.joint_names, cut.joint)} {end}"
        yield upright(place, frame.top + 4, said, "end", 'fill-opacity="0.85"')


def _beside(frame: Frame, others: Sequence[SelfMotionCurve], width: float) -> Iterator[str]:
    """Other self-motions on the same scale of values, small."""
    left = frame.right + _APART
    for k, other in enumerate(others):
        colour = OTHERS[other.branch % len(OTHERS)]
        small = Frame(left, frame.top, _BESIDE, frame.height, _wide(other.window), frame.y)
        yield small.rectangle('fill="none" stroke="currentColor" stroke-opacity="0.25"')
        yield from _branch(small, other, colour, 1.6)
        if other.best is not None:
            s, value = other.best
            value = float(np.clip(value, *frame.y))
            yield star(small.across(s), small.down(value), 5.0, colour)
        if k == 0:
            said = "others" if len(others) > 1 else "other"
            middle = left + (len(others) * (_BESIDE + _APART) - _APART) / 2
            yield text(middle, frame.bottom + 12, said, "middle")
        left += _BESIDE + _APART
