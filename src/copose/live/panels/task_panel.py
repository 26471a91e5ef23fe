"""The panel's part for the task: objective, direction, ellipsoid, mass and collision."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import viser

from copose.live.panels import objectives as aims
from copose.live.panels.controls import Controls, put, see
from copose.problem import Problem


class TaskActs(Protocol):
    """Actions of this part; each returns at once."""

    def set(self, changes: Mapping[str, Any]) -> None:
        """Change settings."""

    def steer(self, changes: Mapping[str, Any]) -> None:
        """Change numbers that the arms follow, such as a mass."""


@dataclass(frozen=True)
class _Direction:
    """The controls of a direction."""

    part: viser.GuiDropdownHandle[str]
    azimuth: viser.GuiSliderHandle[float]
    elevation: viser.GuiSliderHandle[float]


class TaskPanel:
    """The controls of a problem's objective, ellipsoid, mass and collision."""

    def __init__(
        self, controls: Controls, problem: Problem, kinds: Sequence[str], acts: TaskActs
    ) -> None:
        """Build the controls of a problem that can have some kinds of objectives."""
        self._controls, self._gui, self._acts = controls, controls.gui, acts
        self._opened = self._problem = problem
        self._names = [problem.space.coordinates[axis] for axis in problem.axes]
        self._add_aim(problem, kinds)
        self._add_constraints(problem)

    def open(self, problem: Problem) -> None:
        """Take another problem as the one that was opened, whose objective the list offers."""
        self._opened = problem
        if problem.objective.kind not in self._kind.options:
            self._kind.options = (problem.objective.kind, *self._kind.options)

    def show(self, problem: Problem) -> None:
        """Set the controls to the values of a problem."""
        self._problem = problem
        put(self._kind, problem.objective.kind)
        put(self._resolution, problem.ellipsoid.resolution)
        put(self._scaling, problem.ellipsoid.torque_scaling)
        put(self._load, problem.ellipsoid.load_distribution)
        put(self._gravity, problem.ellipsoid.gravity)
        put(self._mass, problem.object.mass)
        put(self._collision, problem.constraints.collision)
        directed = aims.directed(problem.objective.kind)
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

    def _add_aim(self, problem: Problem, kinds: Sequence[str]) -> None:
        """Add the objective, its direction, and the ellipsoid."""
        gui, acts = self._gui, self._acts
        self._kind = gui.add_dropdown(
            "objective", list(kinds), initial_value=problem.objective.kind,
            hint="what the posture is to be best at",
        )  # fmt: skip
        self._controls.when(self._kind, lambda kind: acts.set(
            {"objective": aims.objective_of_kind(self._opened, self._problem, kind)}
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
            self._sets(self._gravity, "ellipsoid.gravity")

    def _add_direction(self, problem: Problem) -> None:
        """Add the direction's part and angles."""
        gui = self._gui
        along = aims.direction_of(problem)
        known = along is not None and len(along) == len(self._names)
        start = along.tolist() if along is not None and known else aims.default_direction(problem)
        part, azimuth, elevation = aims.angles(self._names, start)
        linear = any(name in "xyz" for name in self._names)
        angular = any(name not in "xyz" for name in self._names)
        parts = ["linear"] * linear + ["angular"] * angular
        shown = aims.directed(problem.objective.kind)
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

        def point(_: object) -> None:
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
        """Add mass and collision."""
        gui = self._gui
        self._mass = gui.add_number(
            "object, kg", problem.object.mass, min=min(1e-6, problem.object.mass), step=0.1,
            hint="mass; the inertia stays as it is",
        )  # fmt: skip
        self._controls.when(self._mass, self._weigh)
        self._collision = gui.add_checkbox(
            "collision", problem.constraints.collision, hint="nothing may touch"
        )
        self._sets(self._collision, "constraints.collision")

    def _weigh(self, mass: float) -> None:
        """Change the mass, but to 0, which is typed on the way to 0.5."""
        if mass > 0:
            self._acts.steer({"object.mass": float(mass)})

    def _sets(self, control: Any, key: str) -> None:
        """Let a control set a key."""
        self._controls.when(control, lambda value: self._acts.set({key: value}))

    def _chosen(
        self, label: str, key: str, options: tuple[str, ...], value: str
    ) -> viser.GuiDropdownHandle[str]:
        """A list of the values that a key may have."""
        control = self._gui.add_dropdown(label, options, initial_value=value)
        self._sets(control, key)
        return control
