"""The planner of joint motions along a problem's path."""

from __future__ import annotations

import time

from copose import kernels
from copose.cell.cell import Cell
from copose.kernels import one_at_a_time
from copose.motion.dynamics.rates import JointRates
from copose.motion.path.request import asked
from copose.motion.search.candidates import Ends
from copose.motion.search.effort import PathEffort, path_effort_of
from copose.motion.search.motion_search import MotionSearch
from copose.motion.search.obstruction import Obstruction, unfound
from copose.motion.search.optimiser import MotionOptimiser
from copose.motion.search.reconfiguration import aim
from copose.motion.search.refinement import Refiner
from copose.motion.search.result import Answer
from copose.objectives.registry import objective_of
from copose.posture.model import PostureModel
from copose.posture.search.effort import EffortName
from copose.problem import PathSpec, PlanarWaypoint, Problem, Waypoint
from copose.progress import StoppedError, Tell, sheltered, stage, watched
from copose.results import Motion


class PathPlanner:
    """A planner of motions along the path of one problem; everything is built once.

    Threads may share it, and take turns. A pickled one is its problem, from which it is built anew.

    Attributes:
        problem: as read by `copose.load`.
        path: its ``[path]``.
        build_s: seconds that building took.
    """

    @one_at_a_time
    def __init__(self, problem: Problem, model: PostureModel | None = None) -> None:
        """Build everything that planning needs.

        Args:
            problem: as read by `copose.load`.
            model: of the same problem, if that is built already.

        Raises:
            InputError: a robot cannot be used, or the path cannot be what it asks for.
        """
        began = time.perf_counter()
        self.problem = problem
        self.path = problem.path if problem.path is not None else _still(problem)
        cell = Cell.of(problem) if model is None else model.cell
        self.journey = asked(problem, self.path, cell.arms)
        self._model = PostureModel(cell) if model is None else model
        self._drive = JointRates(self._model, self.journey, self.path.tolerance)
        self._shaper = MotionOptimiser(self._model, self._drive, self.path)
        self._kernels = (*self._shaper.kernels, *self._drive.kernels)
        self.build_s = time.perf_counter() - began

    def __reduce__(self) -> tuple[type[PathPlanner], tuple[Problem]]:
        return type(self), (self.problem,)

    def compile(self) -> bool:
        """Wait until the kernels are compiled; True if they are in use then."""
        return self._compiled(wait=True)

    def _compiled(self, *, wait: bool) -> bool:
        searching = self._model.compiled(wait=wait)
        moving = kernels.build(self._kernels, wait=wait)
        return searching and moving

    @one_at_a_time
    def plan(
        self,
        *,
        seed: int | None = None,
        progress: Tell | None = None,
        time_limit: float | None = None,
        ends: Ends | None = None,
        effort: EffortName | PathEffort = "normal",
    ) -> Motion:
        """The best joint motion along the path.

        Without ``[path]`` the object stays, and the motion is one from the start to the best
        posture that can be reached without letting go.

        Args:
            seed: in place of the file's.
            progress: called with a `copose.Progress` as stages begin and the best so far grows.
            time_limit: s; the best found by then is the answer, with a note, or ``failed`` where
                there is none yet. Answers under a limit may differ from run to run.
            ends: postures to begin and to end with in place of the file's ``start``.
            effort: how much is searched.

        Returns:
            A motion whose ``status`` is ``solved``; ``infeasible`` with when and where as
            ``reason``, or ``failed``.

        Raises:
            InputError: there is no such effort.
        """
        options = path_effort_of(effort)
        answer = Answer(
            problem=self.problem,
            path=self.path,
            cell=self._model.cell,
            objective=self._model.objective,
            build_s=self.build_s,
            began=time.perf_counter(),
        )
        with watched(progress, time_limit):
            try:
                return self._answered(answer, seed, ends, options)
            except StoppedError as stop:
                with sheltered():
                    return answer.stopped(unfound(stop), None)

    def _answered(
        self, answer: Answer, seed: int | None, ends: Ends | None, effort: PathEffort
    ) -> Motion:
        """The result, from the ends given or those of the posture problem."""
        answer.compiled = self._compiled(wait=False)
        target = None
        if self.problem.path is None and ends is None:
            target = aim(self.problem, seed)
            ends = target.ends
            answer.aimed(target.reachable)
        if target is not None and target.ends is None:
            failed = target.solution.status == "failed"
            reason = target.solution.reason or "no posture was found"
            why = Obstruction("failed" if failed else "infeasible", reason)
            return answer.stopped(why, None)
        making = MotionSearch(
            finisher=Refiner(
                path=self.path,
                journey=self.journey,
                model=self._model,
                shaper=self._shaper,
                drive=self._drive,
                options=effort.refining,
            ),
            answer=answer,
            seed=self.problem.search.seed if seed is None else seed,
            options=effort.making,
            routes=effort.routes,
        )
        return making.motion(ends)


def _still(problem: Problem) -> PathSpec:
    """A path on which the object stays where it is."""
    stay = (PlanarWaypoint(),) * 2 if problem.space.planar else (Waypoint(),) * 2
    return PathSpec(waypoints=stay)


def plan(
    problem: Problem,
    *,
    seed: int | None = None,
    progress: Tell | None = None,
    time_limit: float | None = None,
    effort: EffortName | PathEffort = "normal",
) -> Motion:
    """The best joint motion along the path of a problem: `PathPlanner.plan` of a new planner.

    Raises:
        InputError: a robot cannot be used, the path cannot be what it asks for, or there is no such
            effort.
    """
    options = path_effort_of(effort)
    began = time.perf_counter()
    with watched(progress, time_limit):
        try:
            stage("building")
            planner = PathPlanner(problem)
        except StoppedError as stop:
            with sheltered():
                return _unbuilt(problem, began).stopped(unfound(stop), None)
        return planner.plan(seed=seed, effort=options)


def _unbuilt(problem: Problem, began: float) -> Answer:
    """The result's parts where there was no time to build a planner."""
    path = problem.path if problem.path is not None else _still(problem)
    cell = Cell.of(problem)
    asked(problem, path, cell.arms)
    now = time.perf_counter()
    return Answer(problem, path, cell, objective_of(cell), now - began, now)
