"""The most dexterous posture of several robot arms holding one object together.

    problem = copose.load("problems/paper-fig2.toml")
    solution = copose.solve(problem)

Public names load what they need when they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from copose.errors import CoposeError, InputError
from copose.version import __version__

if TYPE_CHECKING:
    from copose.capability import Ellipsoid
    from copose.paths import PathPlanner, plan
    from copose.planning import Check, Planner, check, evaluate, solve, verify
    from copose.problem import Problem, load, parse
    from copose.report import compare, draw
    from copose.results import Motion, Solution, read_motion, read_solution

_HOMES = {
    "Check": "planning",
    "Ellipsoid": "capability",
    "Motion": "results",
    "PathPlanner": "paths",
    "Planner": "planning",
    "Problem": "problem",
    "Solution": "results",
    "check": "planning",
    "compare": "report",
    "draw": "report",
    "evaluate": "planning",
    "load": "problem",
    "parse": "problem",
    "plan": "paths",
    "read_motion": "results",
    "read_solution": "results",
    "solve": "planning",
    "verify": "planning",
}

__all__ = [
    "Check",
    "CoposeError",
    "Ellipsoid",
    "InputError",
    "Motion",
    "PathPlanner",
    "Planner",
    "Problem",
    "Solution",
    "__version__",
    "check",
    "compare",
    "draw",
    "evaluate",
    "load",
    "parse",
    "plan",
    "read_motion",
    "read_solution",
    "solve",
    "verify",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'copose' has no attribute {name!r}")
    return getattr(import_module(f"copose.{_HOMES[name]}"), name)
