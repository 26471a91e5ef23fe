"""The panel's part for the motion along the path: planning, time, curves, saving."""

from __future__ import annotations

from functools import partial
from typing import Protocol

import viser

from copose.live.panels.controls import Controls, put, put_content
from copose.live.panels.markup import line
from copose.live.panels.path_words import instant, motion_headline
from copose.live.panels.readout import notes
from copose.live.plots.path_figure import motion_svg
from copose.live.session.path_motion import PathMotion, PlannedMotion


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
        """Build the controls.

        Args:
            controls: the panel's controls.
            stem: beginning of the names of files.
            acts: the actions.
        """
        self._controls = controls
        self._course: PlannedMotion | None = None
        gui = controls.gui
        self._head = gui.add_html("")
        self._plan = gui.add_button("Plan", icon=viser.Icon.ROUTE)
        controls.clicked(self._plan, acts.plan)
        self._play = gui.add_button("Play", icon=viser.Icon.PLAYER_PLAY, disabled=True)
        controls.clicked(self._play, acts.play)
        self._time = gui.add_slider("time, s", 0.0, 1.0, 0.001, 0.0, disabled=True)
        controls.when(self._time, lambda: acts.go(float(self._time.value)))
        self._instant = gui.add_html("")
        self._curves = gui.add_html("")
        with gui.add_folder("Notes on the motion", expand_by_default=False):
            self._notes = gui.add_html("")
        with gui.add_folder("Save the motion", expand_by_default=False):
            for kind, name, hint in (
                ("motion", f"{stem}-motion", "folder of result.json, trajectory.csv, path.png"),
                ("page", f"{stem}-motion.html", "a page that plays; opens from a file"),
            ):
                text = gui.add_text(kind, name, hint=hint)
                button = gui.add_button(f"Save {kind}")
                controls.clicked(button, partial(self._save, acts, kind, text))
            self._saved = gui.add_html("")

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

    @staticmethod
    def _save(acts: PathActs, kind: str, text: viser.GuiInputHandle[str]) -> None:
        """Write a file of the name that was typed."""
        acts.save(kind, text.value)
