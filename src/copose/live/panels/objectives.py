"""Settings of the panel as changes of a problem: objectives, directions, ellipsoids."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from copose.errors import InputError
from copose.live.problem_file.document import Document
from copose.live.problem_file.tables import tables_of
from copose.poses import Array
from copose.problem import Problem
from copose.report.words import OBJECTIVES
from copose.results import Solution

# Objectives that the page offers, by their kinds.
KINDS = (
    "volume",
    "task-compatibility",
    "worst-direction",
    "isotropy",
    "acceleration",
    "payload",
    "all-round",
    "velocity-volume",
    "force-volume",
)
# Those that take a direction.
DIRECTED = ("task-compatibility", "acceleration")


def offered(document: Document, solution: Solution) -> list[str]:
    """The kinds of objective that a problem can have: with gravity, axes and torque limits as they
    are.

    Args:
        document: of the problem.
        solution: of it, which states the limits.
    """
    limits = [joint.torque for joints in solution.limits.values() for joint in joints]
    now = document.problem({})
    kinds = dict.fromkeys((now.objective.kind, *KINDS))
    return [kind for kind in kinds if kind == now.objective.kind or _fits(document, kind, limits)]


def _fits(document: Document, kind: str, limits: Sequence[float | None]) -> bool:
    if OBJECTIVES[kind].limited and None in limits:
        return False
    try:
        document.problem({"objective": objective_table(document.problem({}), kind)})
    except InputError:
        return False
    return True


def direction_of(problem: Problem) -> Array | None:
    """The first direction of the objective as a unit vector, (m,) or (a,); None without one."""
    objective: Any = problem.objective
    directions = [each.direction for each in getattr(objective, "directions", None) or ()]
    if not directions and getattr(objective, "direction", None) is not None:
        directions = [objective.direction]
    return np.asarray(problem.along(directions[0])) if directions else None


def objective_table(
    problem: Problem, kind: str, direction: Sequence[float] | None = None
) -> Mapping[str, Any]:
    """``[objective]`` of another kind; of the problem's only ``axes`` stay."""
    table: dict[str, Any] = {"kind": kind}
    axes = getattr(problem.objective, "axes", None)
    if axes is not None:
        table["axes"] = list(axes)
    if kind in DIRECTED:
        along = list(direction) if direction is not None else default_direction(problem)
        table["directions"] = [{"direction": [float(x) for x in along]}]
    return table


def objective_of_kind(opened: Problem, now: Problem, kind: str) -> Mapping[str, Any]:
    """``[objective]`` of a kind: as the problem was opened with where that is its kind, so that
    weights and further directions are not lost.
    """
    if kind == opened.objective.kind:
        found: Mapping[str, Any] = tables_of(opened).get("objective", {"kind": kind})
        return found
    return objective_table(now, kind)


def default_direction(problem: Problem) -> list[float]:
    """Upwards; in the plane along y."""
    size = len(problem.axes)
    names = [problem.space.coordinates[axis] for axis in problem.axes]
    up = "y" if problem.space.planar else "z"
    along = [0.0] * size
    along[names.index(up) if up in names else 0] = 1.0
    return along


def pointing(names: Sequence[str], part: str, azimuth: float, elevation: float) -> list[float]:
    """A direction by two angles, degrees, in those of the coordinates that are there.

    Args:
        names: of the coordinates that count, such as x, y, z, roll, pitch, yaw.
        part: linear or angular.
        azimuth: from x towards y.
        elevation: from there towards z; nothing in the plane.
    """
    a, e = math.radians(azimuth), math.radians(elevation)
    vector = (math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e))
    linear = dict(zip("xyz", vector, strict=True))
    angular = dict(zip(("roll", "pitch", "yaw"), vector, strict=True)) | {"angle": 1.0}
    chosen = linear if part == "linear" else angular
    return [chosen.get(name, 0.0) for name in names]


def angles(names: Sequence[str], direction: Sequence[float]) -> tuple[str, float, float]:
    """The part, azimuth and elevation, degrees, whose `pointing` a direction is."""
    by_name = dict(zip(names, direction, strict=True))
    linear = np.array([by_name.get(name, 0.0) for name in "xyz"])
    angular = np.array([by_name.get(name, 0.0) for name in ("roll", "pitch", "yaw")])
    part, vector = ("linear", linear) if np.any(linear) else ("angular", angular)
    if not np.any(vector):
        return part, 0.0, 0.0
    azimuth = math.degrees(math.atan2(vector[1], vector[0]))
    return part, azimuth, math.degrees(math.atan2(vector[2], math.hypot(*vector[:2])))
