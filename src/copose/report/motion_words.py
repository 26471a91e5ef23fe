"""What is said of a motion."""

from __future__ import annotations

from copose.report import style
from copose.results import Motion

_OVER = {"mean": "on average", "worst": "at its worst"}


def motion_heading(motion: Motion) -> str:
    """The problem's name and the gain over least-norm tracking, or the value where there is none.

    Args:
        motion: with knots.
    """
    name, objective = style.short(motion.problem.name, 60), motion.objective
    gained = style.gain_between(motion, objective.before, objective.after)
    if gained:
        over = f"{_OVER[motion.aggregate]}, against least-norm tracking"
        return f"{name}: {style.gain_word(motion)} {gained} {over}"
    words = f"{motion.aggregate} {style.objective_name(motion)} {style.three(objective.after)}"
    fails = motion.least_norm is not None and motion.least_norm.reason is not None
    failed = f"; least-norm tracking fails {failure_words(motion)}" if fails else ""
    return f"{name}: {words} {style.objective_unit(motion)}".rstrip() + failed


def failure_words(motion: Motion) -> str:
    """When least-norm tracking fails."""
    tracking, time = motion.least_norm, motion.time
    assert tracking is not None and time is not None
    known = [t for t, value in zip(time, tracking.objective, strict=True) if value is not None]
    return f"after {style.three(known[-1])} s" if known else "at once"
