"""A motion in numbers, as HTML for the panel: its value, the instant's, and what is wrong."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from copose.live.path_motion import PathMotion
from copose.live.plots.path_figure import cursor_style
from copose.report.look import LOOK
from copose.report.numbers import six, three
from copose.report.words import (
    failure_words,
    gain_between,
    gain_word,
    objective_name,
    objective_unit,
)
from copose.results import Motion

_SMALL = "font-size: 0.8em; line-height: 1.35; padding: 0 0.8em"
_SHOWN = "the motion is shown; drag the arrows, and the arms hold the object where it is put"
_STALE = "the problem is another by now: the motion is to be planned anew"


def motion_headline(path: PathMotion) -> str:
    """The aggregate of the motion, of least-norm tracking, and the gain; or why there is none."""
    rows, title = [], "the motion along the path"
    if path.course is not None:
        motion = path.course.motion
        title = _title(motion, f"{motion.aggregate} ", " along the path")
        before, after = motion.objective.before, motion.objective.after
        rows = [
            ("planned", f"<b>{six(after)}</b>"),
            ("least-norm tracking", escape(_tracking(motion))),
            ("gain", escape(_gain(motion, before, after))),
        ]
    words, colour = path.message, LOOK.over
    if not words and path.stale:
        words, colour = _STALE, LOOK.arms[2]
    return _table(title, rows, words, colour, "copose-path")


def instant_headline(path: PathMotion) -> str:
    """The objective at the instant that is shown, of least-norm tracking, and the gain."""
    course = path.course
    if course is None:
        return ""
    motion, value, tracked = course.motion, course.value(path.time), course.tracked(path.time)
    rows = [
        ("now", f"<b>{six(value)}</b>"),
        ("tracking", six(tracked)),
        ("gain", escape(_gain(motion, tracked, value))),
    ]
    title = _title(motion, "", f" at {path.time:.2f} s of the path")
    return _table(title, rows, _SHOWN, LOOK.arms[0], "copose")


def instant(path: PathMotion) -> str:
    """The time that is shown and the objective then; moves the cursor, too."""
    course = path.course
    if course is None:
        return ""
    share = path.time / course.duration if course.duration else 0.0
    name = objective_name(course.motion)
    value = three(course.value(path.time))
    return (
        f"{cursor_style(share)}<div style='{_SMALL}' id='copose-instant'>at {path.time:.2f} s of "
        f"{course.duration:.3g} s: {escape(name)} <b>{value}</b></div>"
    )


def _tracking(motion: Motion) -> str:
    """What tracking without planning comes to."""
    tracking = motion.least_norm
    if tracking is not None and tracking.reason is not None:
        return f"fails {failure_words(motion)}"
    return six(motion.objective.before)


def _gain(motion: Motion, before: float | None, after: float | None) -> str:
    gained = gain_between(motion, before, after)
    return f"{gain_word(motion)} {gained}" if gained else "–"


def _title(motion: Motion, before: str, after: str) -> str:
    """The objective's name and unit, with words around the name."""
    name = f"{before}{objective_name(motion)}{after}"
    return ", ".join(filter(None, (name, objective_unit(motion))))


def _table(title: str, rows: Sequence[tuple[str, str]], words: str, colour: str, key: str) -> str:
    """Numbers under a title, and a line of words in colour below, if there are any."""
    cells = "".join(
        f'<tr><td style="padding-right: 1em">{name}</td>'
        f'<td id="{key}-{name.split()[-1]}">{value}</td></tr>'
        for name, value in rows
    )
    told = f'<div id="{key}-message" style="color: {colour}">{escape(words)}</div>'
    return (
        f'<div style="{_SMALL}"><div style="font-size: 1.1em"><b>{escape(title)}</b></div>'
        f"<table>{cells}</table>{told if words else ''}</div>"
    )
