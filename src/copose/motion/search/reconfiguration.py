"""Reconfiguring in hand: from the start to the best posture while the object stays where it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.motion.search.candidates import Ends
from copose.posture import Planner
from copose.problem import Problem
from copose.results import Solution


@dataclass(frozen=True, eq=False)
class PostureGoal:
    """The goal of a motion without a path.

    Attributes:
        solution: of the posture problem.
        ends: its start and its best posture that can be reached; None where there is none.
        reachable: whether the best posture of all can be reached; None where it is not known.
    """

    solution: Solution
    ends: Ends | None
    reachable: bool | None


def aim(problem: Problem, seed: int | None) -> PostureGoal:
    """The best posture, or the best one that can be reached without letting go, as a goal."""
    solution = Planner(problem).solve(seed=seed)
    reachable = solution.reachable_from_start
    if solution.after is not None and reachable is not True and not problem.search.reachable:
        within = problem.search.model_copy(update={"reachable": True})
        restricted = problem.model_copy(update={"search": within})
        restricted._source = problem.source
        solution = Planner(restricted).solve(seed=seed)
    if solution.after is None or solution.before is None:
        return PostureGoal(solution, None, reachable)
    first, last = (
        np.concatenate([np.array(q) for q in posture.joints.values()])
        for posture in (solution.before, solution.after)
    )
    return PostureGoal(solution, Ends(first, last), reachable)
