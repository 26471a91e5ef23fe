"""The structure of a problem, and its variants: displaced, one for each case, joints alone free."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from copose.problem.fields import as_tuples
from copose.problem.spec import Problem


def displaced(problem: Problem, offsets: Mapping[str, float]) -> Problem:
    """A problem with its object displaced by x, y, z, m, and roll, pitch, yaw, rad."""
    if not offsets:
        return problem
    return changed(problem, {"object": problem.object.displaced(offsets)})


def case_problems(problem: Problem) -> tuple[Problem, ...]:
    """One problem for every case: its pose, its mass with inertia in proportion, its direction."""
    problems = []
    for case in problem.cases:
        thing, objective = problem.object, problem.objective
        given = ("position", "angle" if problem.space.planar else "rpy")
        update = {key: getattr(case, key) for key in given if getattr(case, key) is not None}
        if case.mass is not None:
            update["mass"] = case.mass
            if thing.inertia is not None:
                inertia = np.array(thing.inertia) * (case.mass / thing.mass)
                update["inertia"] = as_tuples(inertia)
        if case.direction is not None:
            objective = objective.along(case.direction)
        update = {"object": thing.model_copy(update=update), "objective": objective}
        problems.append(changed(problem, update))
    return tuple(problems)


def held(problem: Problem, case: str = "") -> Problem:
    """A problem, or one of its cases by name, with all but joints where the file has it."""
    if problem.cases:
        names = [each.name for each in problem.cases]
        problem = case_problems(problem)[names.index(case)]
    thing = problem.object
    arms = (arm.model_copy(update={"freedom": type(arm.freedom)()}) for arm in problem.arms)
    update: dict[str, object] = {
        "cases": (),
        "object": thing.model_copy(update={"freedom": type(thing.freedom)()}),
        "arms": tuple(arms),
    }
    return changed(problem, update)


def changed(problem: Problem, update: Mapping[str, object]) -> Problem:
    """A problem of the same file with other tables."""
    other = problem.model_copy(update=update)
    other._source = problem.source
    return other


def same_structure(one: Problem, other: Problem, *, movable: bool = False) -> bool:
    """True where two problems differ in parameters alone.

    Parameters are the pose of the object, its mass and inertia, the directions of the objective and
    their weights, and where ``movable``, poses of grasps, and of bases where neither bodies nor
    contacts have limits. Names, paths and seeds do not matter.
    """
    return _structure(one, movable) == _structure(other, movable)


def _structure(problem: Problem, movable: bool) -> dict[str, Any]:
    """Everything but parameters."""
    thing = problem.object
    turn = "angle" if problem.space.planar else "rpy"
    inertia = None if thing.inertia is None else 0.0
    neutral = {"position": None, turn: None, "mass": None, "inertia": inertia}
    arms: tuple[object, ...] = problem.arms
    if movable:
        limits = problem.constraints
        gripped = any(arm.grip.force or arm.grip.moment for arm in problem.arms)
        rooted = limits.collision or limits.internal_force is not None or gripped
        places = {"grasp": None} if rooted else {"grasp": None, "base": None}
        arms = tuple(arm.model_copy(update=places) for arm in problem.arms)
    return {
        "task": problem.task,
        "object": thing.model_copy(update=neutral),
        "arms": arms,
        "ellipsoid": problem.ellipsoid,
        "objective": problem.objective.structure,
        "world": problem.world,
        "constraints": problem.constraints,
        "obstacles": problem.obstacles,
        "cases": problem.cases,
        "reachable": problem.search.reachable,
        "folder": None if problem.source is None else problem.source.parent,
    }
