"""The panel beside the scene: settings, numbers, the search and its optima, saving."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import viser

from copose.live import aims, readout
from copose.live.controls import Controls, put, see
from copose.live.hand_panel import HandActs, HandPanel, put_content
from copose.live.path_panel import PathActs, PathPanel
from copose.live.state import Aim, State
from copose.problem import Problem
from copose.progress import Progress
from copose.report import style
from copose.results import Optimum

# From when on progress is shown, s.
_A_WHILE = 0.3
# How long it stays as it is, s.
_MOMENT = 0.1
# The lightest object that may be typed, kg.
_LIGHTEST = 1e-6
_COLORS = (
    "Orange, at the object: linear accelerations that torques of the unit ball, or within limits, "
    "give it. Purple, above: angular ones."
)
# Buttons for local optima.
_OPTIMA = 8


class Acts(HandActs, Protocol):
    """The actions of the panel; each returns at once."""

    @property
    def path(self) -> PathActs | None:
        """The actions for the motion along the path, where the problem has one."""

    def set(self, changes: Mapping[str, Any]) -> None:
        """Change settings."""

    def steer(self, changes: Mapping[str, Any]) -> None:
        """Change numbers that the arms follow, such as a mass."""

    def search(self, aim: Aim) -> None:
        """Search everything."""

    def choose(self, optimum: Optimum) -> None:
        """Go to a local optimum."""

    def pick(self, case: str) -> None:
        """Show another case."""

    def undo(self) -> None:
        """Undo the last step."""

    def show(self, what: str, visible: bool) -> None:
        """Show or hide a part of the scene."""

    def save(self, kind: str, file: str) -> None:
        """Write a file."""


@dataclass(frozen=True)
class _Direction:
    """The controls of a direction."""

    part: viser.GuiDropdownHandle[str]
    azimuth: viser.GuiSliderHandle[float]
    elevation: viser.GuiSliderHandle[float]

    @property
    def visible(self) -> bool:
        """Whether they are shown."""
        return self.azimuth.visible


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
        self._gui, self._acts, self._problem = gui, acts, problem
        self._opened = problem
        self._controls, self._kinds = Controls(gui), kinds
        self._state: State | None = None
        names = [problem.space.coordinates[axis] for axis in problem.axes]
        self._names = names
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
            self._add_aim(problem)
            self._add_constraints(problem)
            self._bars = gui.add_html("")
            with gui.add_folder("Ellipsoid", expand_by_default=False):
                self._axes = gui.add_html("")
            with gui.add_folder("Notes", expand_by_default=False):
                self._notes = gui.add_html("")
        with tabs.add_tab("Search"):
            self._add_search(problem)
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
            self._set_controls(state.problem)
        if self._state is None or self._state.optima is not state.optima:
            self._list(state)
        self._state = state

    def _set_controls(self, problem: Problem) -> None:
        """Let the controls say what the problem says."""
        self._problem = problem
        put(self._kind, problem.objective.kind)
        put(self._resolution, problem.ellipsoid.resolution)
        put(self._scaling, problem.ellipsoid.torque_scaling)
        put(self._load, problem.ellipsoid.load_distribution)
        put(self._gravity, problem.ellipsoid.gravity)
        put(self._mass, problem.object.mass)
        put(self._collision, problem.constraints.collision)
        directed = problem.objective.kind in aims.DIRECTED
        for control in vars(self._direction).values():
            see(control, directed)
        if problem.space.planar:
            see(self._direction.elevation, False)
            see(self._direction.azimuth, directed and self._direction.part.value == "linear")
        along = aims.direction_of(problem)
        if along is not None and len(along) == len(self._names):
            part, azimuth, elevation = aims.angles(self._names, along.tolist())
            put(self._direction.part, part)
            put(self._direction.azimuth, round(azimuth))
            put(self._direction.elevation, round(elevation))

    def _list(self, state: State) -> None:
        for k, button in enumerate(self._optima):
            visible = k < len(state.optima)
            if visible:
                each = state.optima[k]
                button.label = f"{k + 1}: {style.six(each.objective)}, met ×{each.count}"
            see(button, visible)

    def _add_aim(self, problem: Problem) -> None:
        gui, acts = self._gui, self._acts
        self._kind = gui.add_dropdown(
            "objective", list(self._kinds), initial_value=problem.objective.kind,
            hint="what the posture is to be best at",
        )  # fmt: skip
        self._controls.when(self._kind, lambda: acts.set(
            {"objective": aims.objective_of_kind(self._opened, self._problem, self._kind.value)}
        ))  # fmt: skip
        self._add_direction(problem)
        with gui.add_folder("Measure", expand_by_default=False):
            self._resolution = self._chosen(
                "resolution", "ellipsoid.resolution", ("pseudoinverse", "torque-optimal"),
                problem.ellipsoid.resolution,
            )  # fmt: skip
            self._scaling = self._chosen(
                "torques", "ellipsoid.torque_scaling", ("unit", "limits"),
                problem.ellipsoid.torque_scaling,
            )  # fmt: skip
            self._load = self._chosen(
                "load", "ellipsoid.load_distribution", ("moore-penrose", "nonsqueezing"),
                problem.ellipsoid.load_distribution,
            )  # fmt: skip
            self._gravity = gui.add_checkbox("gravity", problem.ellipsoid.gravity)
            self._controls.when(
                self._gravity, lambda: acts.set({"ellipsoid.gravity": self._gravity.value})
            )

    def _add_direction(self, problem: Problem) -> None:
        gui = self._gui
        along = aims.direction_of(problem)
        known = along is not None and len(along) == len(self._names)
        start = along.tolist() if along is not None and known else aims.default_direction(problem)
        part, azimuth, elevation = aims.angles(self._names, start)
        linear = any(name in "xyz" for name in self._names)
        angular = any(name not in "xyz" for name in self._names)
        parts = ["linear"] * linear + ["angular"] * angular
        shown = problem.objective.kind in aims.DIRECTED
        self._direction = _Direction(
            part=gui.add_dropdown(
                "direction", parts, initial_value=part if part in parts else parts[0], visible=shown
            ),
            azimuth=gui.add_slider(
                "azimuth, °", -180, 180, 1, round(azimuth), visible=shown, hint="from x towards y"
            ),
            elevation=gui.add_slider(
                "elevation, °",
                -90,
                90,
                1,
                round(elevation),
                hint="towards z",
                visible=shown and not problem.space.planar,
            ),
        )

        def point() -> None:
            control = self._direction
            along = aims.pointing(
                self._names, control.part.value, control.azimuth.value, control.elevation.value
            )
            if any(along):
                table = aims.objective_table(self._problem, self._problem.objective.kind, along)
                self._acts.steer({"objective": table})

        for control in vars(self._direction).values():
            self._controls.when(control, point)

    def _add_constraints(self, problem: Problem) -> None:
        gui, acts = self._gui, self._acts
        self._mass = gui.add_number(
            "object, kg", problem.object.mass, min=min(_LIGHTEST, problem.object.mass), step=0.1,
            hint="mass; the inertia stays as it is",
        )  # fmt: skip
        self._controls.when(self._mass, self._weigh)
        self._collision = gui.add_checkbox(
            "collision", problem.constraints.collision, hint="nothing may touch"
        )
        self._controls.when(
            self._collision, lambda: acts.set({"constraints.collision": self._collision.value})
        )

    def _weigh(self) -> None:
        # Who types 0.5 has typed 0 before: to refuse that would take it away from them.
        if self._mass.value > 0:
            self._acts.steer({"object.mass": float(self._mass.value)})

    def _add_search(self, problem: Problem) -> None:
        gui = self._gui
        effort: Any = gui.add_dropdown("effort", ("low", "normal", "high"), initial_value="normal")
        seed = gui.add_number("seed", problem.search.seed, min=0, step=1)
        verify = gui.add_checkbox("verify", False, hint="again, another seed, twice the effort")
        button = gui.add_button("Search", icon=viser.Icon.SEARCH)
        gui.add_markdown("Local optima; click one and the arms go there:")
        self._optima = [gui.add_button("", visible=False) for _ in range(_OPTIMA)]

        def search() -> None:
            self._acts.search(Aim(effort.value, int(seed.value), verify.value))

        self._controls.clicked(button, search)
        for k, each in enumerate(self._optima):
            self._controls.clicked(each, partial(self._choose, k))

    def _choose(self, k: int) -> None:
        if self._state is not None and k < len(self._state.optima):
            self._acts.choose(self._state.optima[k])

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

    def _chosen(
        self, label: str, key: str, options: tuple[str, ...], value: str
    ) -> viser.GuiDropdownHandle[str]:
        """A list of what a key may be."""
        control = self._gui.add_dropdown(label, options, initial_value=value)
        self._controls.when(control, lambda: self._acts.set({key: control.value}))
        return control


def _stem(problem: Problem) -> str:
    """What names of files begin with."""
    return problem.name if problem.source is None else problem.source.stem


def _hint(problem: Problem) -> str:
    """What to do first, in a line."""
    return f"{problem.name}: drag the arrows at the object"
