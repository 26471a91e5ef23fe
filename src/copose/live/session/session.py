"""The problem on the page and the posture of its arms, with changes, searches and undo."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

from copose.batch.point_solver import PlannerCache
from copose.errors import InputError
from copose.live.problem_file.document import Changes, Document, same_layout
from copose.live.session.state import SearchAim, State, Step
from copose.live.session.transition import self_motion_way
from copose.poses import Array
from copose.posture import Planner
from copose.problem import Problem
from copose.progress import Tell, Watch, watched
from copose.results import Optimum, Posture, Solution
from copose.robots import load_arms
from copose.self_motion.misses.gaps import Followed, Gap

Joints: TypeAlias = Mapping[str, Sequence[float]]


@dataclass(frozen=True)
class SessionOptions:
    """Numbers that a session keeps, and differences that count."""

    planners: int = 4  # planners that are kept: another setting needs another one
    steps: int = 100  # steps that can be undone
    better: float = 1e-6  # relative gain from which on a posture is better
    optima: int = 8  # local optima that are listed
    alike: float = 1e-6  # relative difference of objectives up to which they are of one optimum


@dataclass(eq=False)
class Session:
    """A problem that is being changed, and the posture of its arms.

    Every method may take its time and belongs to one thread, but for `interrupt`.
    """

    document: Document  # the problem as it was opened, or as it is at the point of a study
    told: Callable[[State], object]  # function that is told of every new state
    # Function that is called between two postures of a transition, and says whether to go on.
    waited: Callable[[], bool] = lambda: False
    options: SessionOptions = SessionOptions()  # numbers and differences
    state: State = field(init=False)
    _changes: dict[str, Any] = field(default_factory=dict)
    _planners: PlannerCache = field(init=False)
    _steps: list[Step] = field(default_factory=list)
    _watch: Watch | None = None
    # Places of everything at the start of the arms.
    _start_places: Changes = field(default_factory=dict)
    # Settings by which the start was measured last, and the objective there.
    _measured: tuple[Changes, float | None] | None = None

    def __post_init__(self) -> None:
        self._planners = PlannerCache(self.options.planners)

    def open(self) -> None:
        """Find the posture that the page opens with.

        Raises:
            InputError: the problem cannot be used.
        """
        problem = self.document.problem({})
        planner = self._planners.of(problem)
        solution = planner.solve(problem=problem)
        value = solution.objective.before
        self._changes, self._steps = {}, []
        self._start_places, self._measured = {}, ({}, value)
        self.state = State(problem, solution, start=solution.before, start_value=value)
        self._tell(**self._outcome(planner, problem, solution))

    def pick(self, case: str) -> None:
        """Show another case of the problem, as it was opened; no undo goes back from there.

        Raises:
            InputError: that case cannot be used; nothing is changed then.
        """
        before = self.document
        self.document = before.of_case(case)
        try:
            self.open()
        except InputError:
            self.document = before
            raise

    def take(
        self, document: Document, joints: Joints, origin: str, placed: Changes | None = None
    ) -> None:
        """Show another problem, and the arms, rad or m, where they were recorded to hold it there:
        the origin in words, and what was changed there; nothing is searched.

        Raises:
            InputError: they do not hold the object; nothing is changed then.
        """
        changes = dict(placed or {})
        problem = document.problem(changes)
        planner = self._planners.of(problem)
        solution = planner.evaluate(joints, problem=problem)
        if solution.after is None:
            raise InputError(f"the robots are others than at {origin}: {solution.reason}")
        value = solution.objective.after
        self.document, self._changes = document, changes
        self._start_places, self._measured = dict(changes), ({}, value)
        self.state = State(problem, solution, start=solution.after, start_value=value)
        shares = self._shares(planner, problem, solution)
        self._tell(reached=True, origin=origin, shares=shares)

    def stay(self, document: Document, why: str) -> None:
        """Show another problem, and the arms where they were: nothing is known to hold its object,
        and why.

        Raises:
            InputError: it cannot be used; nothing is changed then.
        """
        problem, solution = document.problem({}), self.state.solution
        if not same_layout(problem, self.state.problem):
            # Other arms have not been anywhere.
            rest = {arm.name: [0.0] * arm.n for arm in load_arms(problem)}
            solution = self._planners.of(problem).evaluate(rest, problem=problem)
        self.document, self._changes, self._start_places = document, {}, {}
        self.state = State(problem, solution, message=why)
        self._tell()

    @property
    def spare(self) -> Mapping[str, int]:
        """Degrees of freedom to spare, by arm."""
        return self.planner().spare

    @property
    def changes(self) -> Changes:
        """The values that differ from the problem as it was opened."""
        return dict(self._changes)

    def interrupt(self) -> None:
        """End a search that is under way; from any thread."""
        watch = self._watch
        if watch is not None:
            watch.interrupt()

    @contextmanager
    def watched(self, tell: Tell | None = None) -> Iterator[Watch]:
        """A time in which `interrupt` ends the work."""
        with watched(tell) as self._watch:
            try:
                yield self._watch
            finally:
                self._watch = None

    def mark(self) -> None:
        """Make the present state a step that an undo goes back to."""
        self._keep(self._step())

    def unmark(self) -> None:
        """Forget the last step: nothing has changed since."""
        if self._steps:
            self._steps.pop()

    def undo(self) -> None:
        """Go back to the last step."""
        if self._steps:
            self._back(self._steps.pop())

    def move(self, changes: Changes) -> None:
        """Let the arms follow an object, base or grasp that a hand moves.

        Where they cannot, they stay, and the message says which of them misses by how much.

        Raises:
            InputError: no problem has such places.
        """
        before, problem = dict(self._changes), self._changed(changes)
        places = all(map(_is_place, changes))
        try:
            planner = self._planners.latest(problem) if places else self._planners.of(problem)
            self._follow(planner, problem)
        except Exception:
            self._changes = before
            raise

    def put(self, changes: Changes) -> None:
        """Change values that the posture does not depend on, such as waypoints.

        Raises:
            InputError: no problem has such values; nothing is changed then.
        """
        self._tell(problem=self._changed(changes))

    def change(self, changes: Changes, tell: Tell | None = None) -> None:
        """Change settings, which another search answers; a step that can be undone.

        Raises:
            InputError: no problem has such settings; nothing is changed then.
        """
        step = self._step()
        problem = self._changed(changes)
        try:
            planner = self._planners.of(problem)
            self._keep(step)
            self._tell(problem=problem)
            self._follow(planner, problem)
            self.search(None, tell)
        except Exception:
            self._steps = [other for other in self._steps if other is not step]
            self._back(step)
            raise

    def search(self, aim: SearchAim | None = None, tell: Tell | None = None) -> None:
        """Search everything with the object where it is; the arms move where that is better.

        Args:
            aim: effort, seed and check; default the problem's. With an aim the arms move to the
                best posture of the search even where it is no better.
            tell: function that is told of progress.
        """
        problem = self.state.problem
        planner, asked = self._planners.of(problem), aim or SearchAim()

        with self.watched(tell) as watch:
            solution = planner.solve(
                problem=problem, effort=asked.effort, seed=asked.seed, verify=asked.verify,
                prove=asked.prove,
            )  # fmt: skip
            interrupted = watch.interrupted
        if interrupted and aim is None:
            return
        outcome = self._outcome(planner, problem, solution)
        if aim is None and self.state.reached and outcome["reached"]:
            # A refusal is still to be read.
            outcome["message"] = self.state.message
        better = _better(solution, self.state, self.options.better)
        if aim is None and self.state.reached and not better:
            outcome |= {"solution": self.state.solution, "shares": self.state.shares}
        elif self.state.reached and solution.after is not None:
            outcome["left"] = self._pass_over(planner, solution.after)
        self._tell(**outcome)

    def choose(self, joints: Joints) -> None:
        """Put the arms where they hold the object, such as at a local optimum.

        Raises:
            InputError: the joints do not fit the arms.
        """
        problem = self.state.problem
        solution = self._planners.of(problem).evaluate(joints, problem=problem)
        if solution.status == "solved":
            self._show(problem, solution, searched=False)
        else:
            self._tell(message=solution.reason or "")

    def fail(self, words: str) -> None:
        """Show words on a failure; all else stays."""
        self._tell(message=words)

    def planner(self) -> Planner:
        """The planner of the present problem."""
        return self._planners.of(self.state.problem)

    def _step(self) -> Step:
        """The present state as a step, without the message of a refusal."""
        state = self.state
        state = replace(state, message="") if state.reached else state
        return Step(self.document, self.changes, self._start_places, state)

    def _back(self, step: Step) -> None:
        """Go back to a step."""
        if step.document is not self.document:
            self.document, self._start_places = step.document, step.start_places
            self._measured = None
        self._changes = dict(step.changes)
        self._tell(**{**vars(step.state), "undoable": bool(self._steps)})

    def _keep(self, step: Step) -> None:
        """Add a step; the oldest one is forgotten where there are too many."""
        self._steps = [*self._steps[1 - self.options.steps :], step]

    def _changed(self, changes: Changes) -> Problem:
        """The problem with changes, which count from now on."""
        merged = {**self._changes}
        for key, value in changes.items():
            # A key that is changed again goes to the end: later changes count.
            merged.pop(key, None)
            merged[key] = value
        problem = self.document.problem(merged)
        self._changes = merged
        return problem

    def _follow(self, planner: Planner, problem: Problem) -> None:
        """Show the local optimum that the posture leads to, or why it cannot follow."""
        posture, followed = self.state.posture, Followed(None, {})
        if posture is not None:
            followed = planner.follow(posture.joints, problem=problem)
        if followed.solution is not None:
            # Optima of a search elsewhere are none here.
            self._show(problem, followed.solution, searched=False, optima=())
            return
        self._tell(
            problem=problem, reached=False, searched=False, optima=(),
            message=_missing(followed.gaps),
        )  # fmt: skip

    def _start_value(self, planner: Planner) -> float | None:
        """The objective at the start, by the settings that count now."""
        start = self.state.start
        if start is None:
            return None
        settings = {key: value for key, value in self._changes.items() if not _is_place(key)}
        if self._measured is None or self._measured[0] != settings:
            problem = self.document.problem({**self._start_places, **settings})
            told = planner.evaluate(start.joints, problem=problem)
            self._measured = settings, told.objective.after
        return self._measured[1]

    def _begin(self, solution: Solution) -> None:
        """Start from the first posture that holds the object."""
        self._start_places = {k: value for k, value in self._changes.items() if _is_place(k)}
        self._measured = None
        self.state = replace(self.state, start=solution.before or solution.after)

    def _outcome(self, planner: Planner, problem: Problem, solution: Solution) -> dict[str, Any]:
        """The values of the state that a search changes."""
        search = solution.search
        optima = () if search is None else self._distinct(search.local_optima)
        if solution.after is None:
            shown = self.state.solution if self.state.solution.after is not None else solution
            return {
                "solution": shown, "optima": (), "reached": False, "searched": False,
                "message": f"{solution.status}: {solution.reason}",
            }  # fmt: skip
        if self.state.start is None:
            self._begin(solution)
        return {
            "solution": solution, "optima": optima, "reached": True, "searched": True,
            "message": "", "left": None, "shares": self._shares(planner, problem, solution),
            "start_value": self._start_value(planner),
        }  # fmt: skip

    def _distinct(self, optima: Sequence[Optimum]) -> tuple[Optimum, ...]:
        """The best local optima, of those with one value the first."""
        distinct: list[Optimum] = []
        for optimum in optima:
            value, known = optimum.objective, [other.objective for other in distinct]
            alike = self.options.alike
            if not any(abs(value - other) <= alike * max(1.0, abs(other)) for other in known):
                distinct.append(optimum)
        return tuple(distinct[: self.options.optima])

    def _pass_over(self, planner: Planner, end: Posture) -> Posture | None:
        """Show the transition to a better posture where the arms can hold the object on the way;
        else return the posture that they leave.
        """
        state, start = self.state, self.state.solution.after
        if start is None:
            return None
        way = self_motion_way(planner, state.problem, start.joints, end.joints, planner.spare)
        for q in way[1:-1]:
            if not self.waited():
                break
            self._show(state.problem, planner.evaluate(q, problem=state.problem), searched=False)
        return None if way else start

    def _show(self, problem: Problem, solution: Solution, **changed: Any) -> None:
        """Show a posture that holds the object."""
        planner = self._planners.latest(problem)
        self._tell(
            problem=problem, solution=solution, reached=True, message="", left=None,
            shares=self._shares(planner, problem, solution),
            start_value=self._start_value(planner), **changed,
        )  # fmt: skip

    def _shares(
        self, planner: Planner, problem: Problem, solution: Solution
    ) -> dict[str, Array] | None:
        """Shares of torque limits that hold the object at rest, by arm."""
        if solution.after is None:
            return None
        return planner.holding_shares(solution.after.joints, problem=problem)

    def _tell(self, **changed: Any) -> None:
        """Tell of a new state with changed values."""
        changed.setdefault("undoable", bool(self._steps))
        if "solution" in changed:
            changed.setdefault("origin", "")
        self.state = replace(self.state, **changed)
        self.told(self.state)


def _is_place(key: str) -> bool:
    """True where a key is of a place, of which the start has its own."""
    last = key.rpartition(".")[2]
    return last in ("position", "rpy", "quaternion", "angle", "base", "grasp")


def _better(solution: Solution, state: State, least: float) -> bool:
    """True where a result is better than a state by a relative gain."""
    new, old = solution.objective.after, state.value
    if new is None or old is None:
        return new is not None
    return new > old + least * max(1.0, abs(old))


def _missing(gaps: Mapping[str, Gap]) -> str:
    """A sentence on the arms that miss their grasps, and by how much."""
    if not gaps:
        return "the arms cannot follow here: limits on torques or bodies are in the way"
    misses = []
    for name, gap in gaps.items():
        turned = f" and {math.degrees(gap.angle):.3g}°" if gap.angle else ""
        misses.append(f"arm {name!r} misses its grasp by {gap.distance:.3g} m{turned}")
    return "; ".join(misses)
