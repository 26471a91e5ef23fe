"""The most dexterous posture of several robot arms holding one object together.

    problem = copose.load("problems/paper-fig2.toml")
    solution = copose.solve(problem)

Public names load what they need when they are first used.
"""

# Nothing is imported before it is needed: the command comes by here before it can heed ^C.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from copose.batch import run_study
    from copose.capability import Ellipsoid
    from copose.errors import CoposeError, InputError
    from copose.formats import export
    from copose.live import LivePage, open_live
    from copose.loader import load, parse
    from copose.motion import PathPlanner, plan
    from copose.posture import Planner, solve
    from copose.posture.evaluation import evaluate, verify
    from copose.posture.inspection import Check, check
    from copose.problem import Problem
    from copose.progress import Progress
    from copose.report import compare, draw
    from copose.results import Motion, Solution, read_motion, read_solution
    from copose.studies import read_study
    from copose.version import __version__

_HOMES = {
    "Check": "posture.inspection",
    "CoposeError": "errors",
    "Ellipsoid": "capability",
    "InputError": "errors",
    "LivePage": "live",
    "Motion": "results",
    "PathPlanner": "motion",
    "Planner": "posture",
    "Problem": "problem",
    "Progress": "progress",
    "Solution": "results",
    "__version__": "version",
    "check": "posture.inspection",
    "compare": "report",
    "draw": "report",
    "evaluate": "posture.evaluation",
    "export": "formats",
    "load": "loader",
    "open_live": "live",
    "parse": "loader",
    "plan": "motion",
    "read_motion": "results",
    "read_solution": "results",
    "read_study": "studies",
    "run_study": "batch",
    "solve": "posture",
    "verify": "posture.evaluation",
}

__all__ = [
    "Check",
    "CoposeError",
    "Ellipsoid",
    "InputError",
    "LivePage",
    "Motion",
    "PathPlanner",
    "Planner",
    "Problem",
    "Progress",
    "Solution",
    "__version__",
    "check",
    "compare",
    "draw",
    "evaluate",
    "export",
    "load",
    "open_live",
    "parse",
    "plan",
    "read_motion",
    "read_solution",
    "read_study",
    "run_study",
    "solve",
    "verify",
]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'copose' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"copose.{_HOMES[name]}"), name)
