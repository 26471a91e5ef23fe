"""The solver of a study's points: planners are built once per structure, points move parameters."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

from copose.errors import InputError
from copose.motion import plan
from copose.posture import Planner
from copose.posture.evaluation import evaluate
from copose.problem import Problem, changed
from copose.progress import StoppedError, heed, hushed, watched
from copose.results import Motion, Solution
from copose.studies.points.line import PointLine
from copose.studies.points.points import Point
from copose.studies.points.problems import PointProblems
from copose.studies.study import Study
from copose.studies.study_file import CommandName, EffortName


class PlannerCache:
    """The planners that were used last, the latest at the end."""

    def __init__(self, most: int) -> None:
        self._most, self._planners = most, list[Planner]()

    def __iter__(self) -> Iterator[Planner]:
        return iter(self._planners)

    def of(self, problem: Problem) -> Planner:
        """A planner of a problem's structure, built where there is none."""
        for planner in self._planners:
            if planner.fits(problem):
                self._planners.remove(planner)
                break
        else:
            planner = Planner(problem, movable=True)
        self._planners = [*self._planners[1 - self._most :], planner]
        return planner

    def latest(self, problem: Problem) -> Planner:
        """The planner that was used last, or the first one for a problem.

        While something is moved, bodies that move with a base stay in it as they were.
        """
        return self._planners[-1] if self._planners else self.of(problem)


@dataclass(frozen=True)
class Recipe:
    """The part of all points of a study that is the same: small, and sent to every worker."""

    problems: PointProblems  # by the values of a point
    command: CommandName  # what is done with each
    effort: EffortName  # of the search
    record: tuple[str, ...]  # dotted paths of the numbers to record
    limit: float | None = None  # s that a point may take; None for no limit

    @classmethod
    def of(cls, study: Study, limit: float | None = None) -> Recipe:
        """The recipe of a study, with a limit in s for each of its points."""
        file = study.file
        return cls(study.problems, file.command, file.effort, file.record, limit)


def points_of(study: Study, numbers: Iterable[int]) -> Iterator[Point]:
    """The points of a study with these numbers."""
    for number in numbers:
        values, seed = study.points.values(number), study.points.seed(number)
        yield Point(number, values, seed, study.hashes.at(values, seed))


Guard: TypeAlias = Callable[[Point], AbstractContextManager[None]]
"""A context for a point."""


class PointSolver:
    """A solver of points one after the other; the line of a point depends on the point alone."""

    def __init__(self, recipe: Recipe, planners: int = 8) -> None:
        """A solver that keeps so many planners of different structures."""
        self._recipe, self._planners = recipe, PlannerCache(planners)

    def prepare(self, values: Mapping[str, Any]) -> None:
        """Build what a point with these values needs.

        Raises:
            InputError: the problem is wrong there.
        """
        self._planner(self._recipe.problems.at(values))

    def line(self, point: Point, solving: Guard = lambda _: nullcontext()) -> PointLine:
        """The line of a point; whatever fails is a line that says so. A context may be entered
        while it is being solved, all built.

        Raises:
            StoppedError: the call around has to end.
        """
        began = time.perf_counter()
        try:
            line = self._line(point, solving)
        except StoppedError:
            raise
        except InputError as error:
            line = PointLine(point, "failed", str(error))
        except Exception as error:
            line = PointLine(point, "failed", f"internal error: {type(error).__name__}: {error}")
        heed()
        return replace(line, seconds=time.perf_counter() - began)

    def _line(self, point: Point, solving: Guard) -> PointLine:
        problem = self._recipe.problems.at(point.values)
        planner = self._planner(problem)
        limit, began = self._recipe.limit, time.perf_counter()
        late = f"stopped by the limit of {limit:g} s a point" if limit is not None else ""
        with solving(point), hushed(), watched(limit=limit, began=began) as watch:
            try:
                answer = self._answer(problem, planner, point.seed)
            except StoppedError:
                if watch.interrupted:
                    raise
                return PointLine(point, "failed", late, stopped=True)
        if limit is not None and time.perf_counter() - began >= limit:
            return PointLine(point, "failed", late, stopped=True)
        return PointLine.of(point, problem, answer, self._recipe.record)

    def _planner(self, problem: Problem) -> Planner | None:
        """The planner for a problem, with compiled kernels, which round otherwise than what serves
        before; None where none is kept.
        """
        command = self._recipe.command
        if command == "path" or (command == "evaluate" and not _plain(problem)):
            return None
        if command == "evaluate":
            # To measure a posture a planner need not know a start.
            arms = tuple(arm.model_copy(update={"start": None}) for arm in problem.arms)
            problem = changed(problem, {"arms": arms})
        planner = self._planners.of(problem)
        planner.compile()
        return planner

    def _answer(self, problem: Problem, planner: Planner | None, seed: int) -> Solution | Motion:
        recipe = self._recipe
        if recipe.command == "path":
            return plan(problem, seed=seed, effort=recipe.effort)
        if planner is None:
            return evaluate(problem)
        if recipe.command == "solve":
            return planner.solve(problem=problem, seed=seed, effort=recipe.effort)
        starts = {arm.name: arm.start or () for arm in problem.arms}
        return planner.evaluate(starts, problem=problem, everything=bool(recipe.record))


def _plain(problem: Problem) -> bool:
    """True where a posture has nothing but joints to tell, and stands in the file."""
    free = problem.object.freedom.ranges or any(
        arm.freedom.base.ranges or arm.freedom.grasp.ranges for arm in problem.arms
    )
    return not (free or problem.cases) and all(arm.start is not None for arm in problem.arms)
