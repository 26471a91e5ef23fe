"""Objectives and directions that the panel sets, as tables of a problem."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from copose.errors import InputError
from copose.live.problem_file.document import Document, tables_of
from copose.poses import Array
from copose.problem import OBJECTIVE_TABLES, Problem
from copose.report.words import OBJECTIVE_WORDS
from copose.results import Solution

KINDS = tuple(dict.fromkeys((*OBJECTIVE_WORDS, *OBJECTIVE_TABLES)))
"""Kinds of objectives that the page offers."""


def offered(document: Document, solution: Solution) -> list[str]:
    """Kinds of objectives that a problem can have with its gravity, axes and torque limits, which a
    result of it states.
    """
    limits = [joint.torque for joints in solution.limits.values() for joint in joints]
    own = document.problem({}).objective.kind
    kinds = dict.fromkeys((own, *KINDS))
    return [kind for kind in kinds if kind == own or _fits(document, kind, limits)]


def _fits(document: Document, kind: str, limits: Sequence[float | None]) -> bool:
    """True where a problem can have a kind of objective."""
    if OBJECTIVE_TABLES[kind].torque_limited and None in limits:
        return False
    try:
        document.problem({"objective": objective_table(document.problem({}), kind)})
    except InputError:
        return False
    return True


def directed(kind: str) -> bool:
    """True where the panel sets a direction of a kind of objective."""
    return kind in ("task-compatibility", "acceleration")


def direction_of(problem: Problem) -> Array | None:
    """The first direction of the objective as a unit vector, (m,) or (a,); None without one."""
    objective: Any = problem.objective
    directions = [entry.direction for entry in getattr(objective, "directions", None) or ()]
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
    if directed(kind):
        along = list(direction) if direction is not None else default_direction(problem)
        table["directions"] = [{"direction": [float(x) for x in along]}]
    return table


def objective_of_kind(opened: Problem, now: Problem, kind: str) -> Mapping[str, Any]:
    """``[objective]`` of a kind: the one that the problem was opened with where it is of that kind,
    so that weights and further directions are kept.
    """
    if kind == opened.objective.kind:
        table: Mapping[str, Any] = tables_of(opened).get("objective", {"kind": kind})
        return table
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
    """A direction by two angles, degrees, in the coordinates that count.

    Args:
        names: names of these coordinates, such as x, y, z, roll, pitch, yaw.
        part: linear or angular.
        azimuth: from x towards y.
        elevation: from there towards z; without effect in the plane.
    """
    a, e = math.radians(azimuth), math.radians(elevation)
    vector = (math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e))
    linear = dict(zip("xyz", vector, strict=True))
    angular = dict(zip(("roll", "pitch", "yaw"), vector, strict=True)) | {"angle": 1.0}
    chosen = linear if part == "linear" else angular
    return [chosen.get(name, 0.0) for name in names]


def angles(names: Sequence[str], direction: Sequence[float]) -> tuple[str, float, float]:
    """The part, azimuth and elevation, degrees, of a direction; the inverse of `pointing`."""
    by_name = dict(zip(names, direction, strict=True))
    linear = np.array([by_name.get(name, 0.0) for name in "xyz"])
    angular = np.array([by_name.get(name, 0.0) for name in ("roll", "pitch", "yaw")])
    part, vector = ("linear", linear) if np.any(linear) else ("angular", angular)
    if not np.any(vector):
        return part, 0.0, 0.0
    azimuth = math.degrees(math.atan2(vector[1], vector[0]))
    return part, azimuth, math.degrees(math.atan2(vector[2], math.hypot(*vector[:2])))
