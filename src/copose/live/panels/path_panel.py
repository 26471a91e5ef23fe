"""The panel's part for the motion along the path: planning, time, curves, saving."""

from __future__ import annotations

from html import escape
from typing import Protocol

import viser

from copose.live.panels.controls import Controls, put, put_content
from copose.live.panels.readout import SMALL, line, message, notes, titled_table
from copose.live.plots.path_figure import cursor_style, motion_svg
from copose.live.session.path_motion import PathMotion, PlannedMotion
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


class PathActs(Protocol):
    """The actions of this part; each returns at once."""

    def plan(self) -> None:
        """Plan the motion, or end planning that is under way."""

    def go(self, time: float) -> None:
        """Show an instant, s."""

    def play(self) -> None:
        """Play the motion, or stop it."""

    def save(self, kind: str, place: str) -> None:
        """Write the motion: a folder of files, or a page."""


class PathPanel:
    """Buttons, the slider of time, numbers and curves."""

    def __init__(self, controls: Controls, stem: str, acts: PathActs) -> None:
        """Build the controls; names of files begin with a stem."""
        self._controls = controls
        self._course: PlannedMotion | None = None
        gui = controls.gui
        self._head = gui.add_html("")
        self._plan = gui.add_button("Plan", icon=viser.Icon.ROUTE)
        controls.clicked(self._plan, acts.plan)
        self._play = gui.add_button("Play", icon=viser.Icon.PLAYER_PLAY, disabled=True)
        controls.clicked(self._play, acts.play)
        self._time = gui.add_slider("time, s", 0.0, 1.0, 0.001, 0.0, disabled=True)
        controls.when(self._time, acts.go)
        self._instant = gui.add_html("")
        self._curves = gui.add_html("")
        with gui.add_folder("Notes on the motion", expand_by_default=False):
            self._notes = gui.add_html("")
        with gui.add_folder("Save the motion", expand_by_default=False):
            folder = "folder of result.json, trajectory.csv, path.png"
            page = "a page that plays; opens from a file"
            self._saved = controls.add_saving(
                acts.save, ("motion", f"{stem}-motion", folder),
                ("page", f"{stem}-motion.html", page),
            )  # fmt: skip

    def show(self, path: PathMotion) -> None:
        """Show the motion, where there is one, and the instant that is looked at."""
        with self._controls.setting():
            put_content(self._head, motion_headline(path))
            if path.course is not None and path.course is not self._course:
                self._course = path.course
                self._time.max = max(path.course.duration, self._time.step)
                self._curves.content = motion_svg(path.course.motion)
                self._notes.content = notes(path.course.motion.notes)
            self._enable()
            self._show_instant(path)

    def show_instant(self, path: PathMotion) -> None:
        """Show the instant that is looked at."""
        with self._controls.setting():
            self._show_instant(path)

    def planning(self, under_way: bool) -> None:
        """Show whether planning is under way: the button then ends it."""
        self._plan.label = "Stop planning" if under_way else "Plan"
        self._enable(not under_way)

    def playing(self, under_way: bool) -> None:
        """Show whether the motion plays: the button then stops it."""
        label = "Pause" if under_way else "Play"
        if self._play.label != label:
            self._play.label = label
            self._play.icon = viser.Icon.PLAYER_PAUSE if under_way else viser.Icon.PLAYER_PLAY

    def said(self, words: str) -> None:
        """Show the outcome of saving."""
        self._saved.content = line(words)

    def _show_instant(self, path: PathMotion) -> None:
        put(self._time, round(path.time, 3))
        put_content(self._instant, instant(path))

    def _enable(self, idle: bool = True) -> None:
        """Enable playing where there is a motion, and nothing is being planned."""
        enabled = idle and self._course is not None
        for control in (self._play, self._time):
            if control.disabled == enabled:
                control.disabled = not enabled
