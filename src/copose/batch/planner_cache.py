"""Planners that are kept while problems of their structure come again."""

from __future__ import annotations

from collections.abc import Iterator

from copose.posture import Planner
from copose.problem import Problem


class PlannerCache:
    """The planners that were used last, the latest at the end."""

    def __init__(self, most: int) -> None:
        """An empty cache of a size."""
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
