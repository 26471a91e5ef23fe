"""Postures and motions as pages to look at."""

from __future__ import annotations

from copose.formats.postures import ExportedPosture, knots, problem_of
from copose.problem import Problem
from copose.results import Motion


def posture_page(exported: ExportedPosture) -> str:
    """One page that shows a posture, and the one before as a ghost.

    Raises:
        InputError: the problem cannot be read or is not the result's, or viser is not installed.
    """
    # Pages need packages that the other formats do without.
    from copose.viewer import page_html

    solution = exported.solution
    problem = problem_of(solution, exported.problem, "html")
    return page_html(solution, problem, posture=exported.posture)


def motion_page(motion: Motion, problem: Problem | None) -> str:
    """One page that plays a motion.

    Raises:
        InputError: nothing moves, the problem cannot be read or is not the result's, or viser is
            not installed.
    """
    knots(motion)
    from copose.viewer import page_html

    return page_html(motion, problem_of(motion, problem, "html"))
