"""The structure of a problem: all but the numbers that a planner takes as parameters."""

from __future__ import annotations

from typing import Any

from copose.problem.spec import Problem


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
