"""The panel beside the scene: settings, numbers, the search and its optima, saving."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import viser

from copose.live.panels import readout
from copose.live.panels.controls import Controls, put_content, see
from copose.live.panels.hand_panel import HandActs, HandPanel
from copose.live.panels.path_panel import PathActs, PathPanel
from copose.live.panels.readout import line
from copose.live.panels.search_panel import SearchActs, SearchPanel
from copose.live.panels.task_panel import TaskActs, TaskPanel
from copose.live.session.state import State
from copose.problem import Problem
from copose.progress import Progress


@dataclass(frozen=True)
class ProgressTimes:
    """Times of the bar of progress, s."""

    after: float = 0.3  # time after which it is shown
    rest: float = 0.1  # time for which it stays


class Acts(TaskActs, SearchActs, HandActs, Protocol):
    """The actions of the panel; each returns at once."""

    @property
    def path(self) -> PathActs | None:
        """The actions for the motion along the path, where the problem has one."""

    def pick(self, case: str) -> None:
        """Show another case."""

    def undo(self) -> None:
        """Undo the last step."""

    def show(self, what: str, visible: bool) -> None:
        """Show or hide a part of the scene."""

    def save(self, kind: str, file: str) -> None:
        """Write a file."""


class PagePanel:
    """The controls of a page: it shows states, and its `Acts` do what hands want."""

    def __init__(
        self,
        gui: viser.GuiApi,
        problem: Problem,
        spare: Mapping[str, int],
        acts: Acts,
        kinds: Sequence[str],
        cases: Sequence[str] = (),
        times: ProgressTimes = ProgressTimes(),
    ) -> None:
        """Build the controls of a problem with some degrees of freedom to spare, by arm, kinds of
        objectives that it can have, and cases, of which the first is shown.
        """
        self._gui, self._acts, self._controls, self._times = gui, acts, Controls(gui), times
        self._state: State | None = None
        self._head = gui.add_html(f"<div>{_hint(problem)}</div>")
        self._doing = gui.add_html("", visible=False)
        self._bar = gui.add_progress_bar(0.0, animated=True, visible=False)
        self._told = 0.0
        self._undo = gui.add_button("Undo", disabled=True, icon=viser.Icon.ARROW_BACK_UP)
        self._controls.clicked(self._undo, acts.undo)
        self._own: list[Any] = [self._head, self._doing, self._bar, self._undo]
        if cases:
            case = gui.add_dropdown("case", list(cases), hint="each is a task of its own here")
            self._controls.when(case, acts.pick)
            self._own.append(case)
        tabs = gui.add_tab_group()
        self._own.append(tabs)
        with tabs.add_tab("Cell"):
            self._task = TaskPanel(self._controls, problem, kinds, acts)
            self._bars = gui.add_html("")
            with gui.add_folder("Ellipsoid", expand_by_default=False):
                self._axes = gui.add_html("")
            with gui.add_folder("Notes", expand_by_default=False):
                self._notes = gui.add_html("")
        with tabs.add_tab("Search"):
            self._search = SearchPanel(self._controls, problem.search.seed, acts)
        with tabs.add_tab("By hand"):
            self.hand = HandPanel(self._controls, spare, acts)
        if acts.path is not None:
            with tabs.add_tab("Path"):
                self.path = PathPanel(self._controls, _stem(problem), acts.path)
        with tabs.add_tab("View"):
            self._add_view(problem)
        with tabs.add_tab("Save"):
            stem = _stem(problem)
            self._saved = self._controls.add_saving(
                acts.save, ("problem", f"{stem}-live.toml", None), ("result", "result.json", None),
                ("picture", "before_after.png", None), ("page", f"{stem}.html", None),
            )  # fmt: skip
        self.tabs = tabs

    def open(self, problem: Problem) -> None:
        """Take another problem, with the same controls, as the one that was opened."""
        with self._controls.setting():
            self._task.open(problem)

    def remove(self) -> None:
        """Take all controls away."""
        for control in self._own:
            control.remove()

    def show(self, state: State) -> None:
        """Show a state, and set the controls to its values."""
        with self._controls.setting():
            self._show(state)

    def show_instant(self, head: str, state: State) -> None:
        """Show, in place of the posture, arms at an instant of a motion under a headline, HTML."""
        put_content(self._head, head)
        put_content(self._bars, readout.joint_bars(state))

    def progress(self, now: Progress | None) -> None:
        """Show the progress of a search that takes a while; None hides it."""
        if now is None:
            see(self._bar, False)
            see(self._doing, False)
            return
        last, self._told = self._told, time.monotonic()
        if now.elapsed < self._times.after or self._told < last + self._times.rest:
            self._told = last
            return
        see(self._bar, True)
        see(self._doing, True)
        put_content(self._doing, line(f"{now.stage} … {now.elapsed:.1f} s"))
        if now.total:
            self._bar.value = 100.0 * min(1.0, (now.done or 0) / now.total)  # type: ignore[misc]

    def said(self, words: str) -> None:
        """Show the outcome of saving."""
        self._saved.content = line(words)

    def _show(self, state: State) -> None:
        """Show those parts of a state that are new."""
        put_content(self._head, readout.headline(state))
        put_content(self._bars, readout.joint_bars(state))
        if self._state is None or self._state.solution is not state.solution:
            self._axes.content = readout.semi_axes(state)
            self._notes.content = readout.notes(state.solution.notes)
        if self._undo.disabled == state.undoable:
            self._undo.disabled = not state.undoable
        # Controls that were refused go back to the problem's values.
        if self._state is None or self._state.problem is not state.problem or state.message:
            self._task.show(state.problem)
        if self._state is None or self._state.optima is not state.optima:
            self._search.show(state.optima, state.solution)
        self._state = state

    def _add_view(self, problem: Problem) -> None:
        """Add the boxes that show and hide parts of the scene."""
        parts = {
            "linear ellipsoid": True,
            "angular ellipsoid": True,
            "exact set": False,
            "start, as a ghost": True,
            "frames": True,
            "drag bases": False,
            "drag grasps": False,
            "drag obstacles": False,
            "drag waypoints": False,
            "path": True,
        }
        if not any(axis in problem.space.angular for axis in problem.axes):
            del parts["angular ellipsoid"]
        if not problem.obstacles:
            del parts["drag obstacles"]
        if problem.path is None:
            del parts["drag waypoints"], parts["path"]
        self._gui.add_markdown(
            "Orange, at the object: linear accelerations that torques of the unit ball, or within "
            "limits, give it. Purple, above: angular ones."
        )
        for name, value in parts.items():
            box = self._gui.add_checkbox(name, value)
            self._controls.when(box, partial(self._acts.show, name))


def _stem(problem: Problem) -> str:
    """The beginning of the names of files."""
    return problem.name if problem.source is None else problem.source.stem


def _hint(problem: Problem) -> str:
    """A line on the first thing to do."""
    return f"{problem.name}: drag the arrows at the object"
