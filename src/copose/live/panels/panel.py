"""The panel beside the scene: settings, numbers, the search and its optima, saving."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Protocol

import viser

from copose.live.panels import readout
from copose.live.panels.controls import Controls, see
from copose.live.panels.hand_panel import HandActs, HandPanel, put_content
from copose.live.panels.path_panel import PathActs, PathPanel
from copose.live.panels.search_panel import SearchActs, SearchPanel
from copose.live.panels.task_panel import TaskActs, TaskPanel
from copose.live.state import State
from copose.problem import Problem
from copose.progress import Progress

# From when on progress is shown, s.
_A_WHILE = 0.3
# How long it stays as it is, s.
_MOMENT = 0.1
_COLORS = (
    "Orange, at the object: linear accelerations that torques of the unit ball, or within limits, "
    "give it. Purple, above: angular ones."
)


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


class Panel:
    """The controls of a page; what it shows is a state's, what is done is for its `Acts`."""

    def __init__(
        self,
        gui: viser.GuiApi,
        problem: Problem,
        spare: Mapping[str, int],
        acts: Acts,
        kinds: Sequence[str],
        cases: Sequence[str] = (),
    ) -> None:
        """Build the controls.

        Args:
            gui: where.
            problem: that the page opens with.
            spare: degrees of freedom to spare, by arm.
            acts: what is done.
            kinds: objectives that the problem can have.
            cases: names of the file's, of which the first is shown.
        """
        self._gui, self._acts, self._controls = gui, acts, Controls(gui)
        self._state: State | None = None
        self._head = gui.add_html(f"<div>{_hint(problem)}</div>")
        self._doing = gui.add_html("", visible=False)
        self._bar = gui.add_progress_bar(0.0, animated=True, visible=False)
        self._told = 0.0
        self._undo = gui.add_button("Undo", disabled=True, icon=viser.Icon.ARROW_BACK_UP)
        self._controls.clicked(self._undo, acts.undo)
        if cases:
            case = gui.add_dropdown("case", list(cases), hint="each is a task of its own here")
            self._controls.when(case, lambda: acts.pick(case.value))
        tabs = gui.add_tab_group()
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
            self._add_saving(problem)
        self.tabs = tabs

    def show(self, state: State) -> None:
        """Show a state; controls go where it is."""
        with self._controls.setting():
            self._show(state)

    def show_instant(self, head: str, state: State) -> None:
        """Show, in place of the posture, arms at an instant of a motion.

        Args:
            head: what is said of it, HTML.
            state: with its measures.
        """
        put_content(self._head, head)
        put_content(self._bars, readout.joint_bars(state))

    def progress(self, now: Progress | None) -> None:
        """Show how far a search is that takes a while; nothing once it is over."""
        if now is None:
            see(self._bar, False)
            see(self._doing, False)
            return
        last, self._told = self._told, time.monotonic()
        if now.elapsed < _A_WHILE or self._told < last + _MOMENT:
            self._told = last
            return
        see(self._bar, True)
        see(self._doing, True)
        put_content(self._doing, readout.line(f"{now.stage} … {now.elapsed:.1f} s"))
        if now.total:
            self._bar.value = 100.0 * min(1.0, (now.done or 0) / now.total)  # type: ignore[misc]

    def said(self, words: str) -> None:
        """Show what became of saving."""
        self._saved.content = readout.line(words)

    def _show(self, state: State) -> None:
        put_content(self._head, readout.headline(state))
        put_content(self._bars, readout.joint_bars(state))
        if self._state is None or self._state.solution is not state.solution:
            self._axes.content = readout.semi_axes(state)
            self._notes.content = readout.notes(state.solution.notes)
        if self._undo.disabled == state.undoable:
            self._undo.disabled = not state.undoable
        # What was refused is not what the problem says.
        if self._state is None or self._state.problem is not state.problem or state.message:
            self._task.show(state.problem)
        if self._state is None or self._state.optima is not state.optima:
            self._search.show(state.optima)
        self._state = state

    def _add_view(self, problem: Problem) -> None:
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
        self._gui.add_markdown(_COLORS)
        for name, value in parts.items():
            box = self._gui.add_checkbox(name, value)
            self._controls.when(box, partial(self._see, name, box))

    def _add_saving(self, problem: Problem) -> None:
        gui = self._gui
        stem = _stem(problem)
        kinds = {
            "problem": f"{stem}-live.toml",
            "result": "result.json",
            "picture": "before_after.png",
            "page": f"{stem}.html",
        }
        for kind, name in kinds.items():
            text = gui.add_text(kind, name)
            self._controls.clicked(gui.add_button(f"Save {kind}"), partial(self._save, kind, text))
        self._saved = gui.add_html("")

    def _see(self, name: str, box: Any) -> None:
        self._acts.show(name, box.value)

    def _save(self, kind: str, text: Any) -> None:
        self._acts.save(kind, text.value)


def _stem(problem: Problem) -> str:
    """What names of files begin with."""
    return problem.name if problem.source is None else problem.source.stem


def _hint(problem: Problem) -> str:
    """What to do first, in a line."""
    return f"{problem.name}: drag the arrows at the object"
