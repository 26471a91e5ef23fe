"""Motions in numbers, as HTML for the panel."""

from __future__ import annotations

from html import escape

from copose.live.panels.markup import SMALL, message, titled_table
from copose.live.plots.path_figure import cursor_style
from copose.live.session.path_motion import PathMotion
from copose.report.look import LOOK
from copose.report.words import (
    failure_words,
    gain_between,
    gain_word,
    objective_name,
    objective_unit,
    six,
    three,
)
from copose.results import Motion


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
        words = "the problem is another by now: the motion is to be planned anew"
        colour = LOOK.arms[2]
    below = message(words, colour, "copose-path") if words else ""
    return titled_table(title, rows, below, "copose-path")


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
    words = "the motion is shown; drag the arrows, and the arms hold the object where it is put"
    return titled_table(title, rows, message(words, LOOK.arms[0], "copose"), "copose")


def instant(path: PathMotion) -> str:
    """The time that is shown and the objective then; moves the cursor, too."""
    course = path.course
    if course is None:
        return ""
    share = path.time / course.duration if course.duration else 0.0
    name = objective_name(course.motion)
    value = three(course.value(path.time))
    return (
        f"{cursor_style(share)}<div style='{SMALL}' id='copose-instant'>at {path.time:.2f} s of "
        f"{course.duration:.3g} s: {escape(name)} <b>{value}</b></div>"
    )


def _tracking(motion: Motion) -> str:
    """The aggregate of least-norm tracking, or its failure."""
    tracking = motion.least_norm
    if tracking is not None and tracking.reason is not None:
        return f"fails {failure_words(motion)}"
    return six(motion.objective.before)


def _gain(motion: Motion, before: float | None, after: float | None) -> str:
    """The gain from one value to another, with the quantity that it is of."""
    gained = gain_between(motion, before, after)
    return f"{gain_word(motion)} {gained}" if gained else "–"


def _title(motion: Motion, before: str, after: str) -> str:
    """The objective's name and unit, with words around the name."""
    name = f"{before}{objective_name(motion)}{after}"
    return ", ".join(filter(None, (name, objective_unit(motion))))
