"""The structure of a problem: all but the numbers that a planner takes as parameters."""

from __future__ import annotations

from typing import Any

from copose.problem.objectives import (
    AccelerationObjective,
    ObjectiveSpec,
    PayloadObjective,
    TaskCompatibilityObjective,
    WeightedDirection,
)
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
        "objective": _aim(problem.objective),
        "world": problem.world,
        "constraints": problem.constraints,
        "obstacles": problem.obstacles,
        "cases": problem.cases,
        "reachable": problem.search.reachable,
        "folder": None if problem.source is None else problem.source.parent,
    }


def _aim(objective: ObjectiveSpec) -> ObjectiveSpec:
    """An objective without the numbers of its directions."""
    if isinstance(objective, TaskCompatibilityObjective):
        unit = WeightedDirection.model_construct(direction=(), weight=1.0)
        return objective.model_copy(update={"directions": (unit,) * len(objective.directions)})
    if isinstance(objective, AccelerationObjective):
        # Its unit depends on which coordinates a direction has.
        pattern = tuple(tuple(bool(x) for x in u) for u in objective.wanted)
        return objective.model_copy(update={"direction": pattern, "directions": None})
    if isinstance(objective, PayloadObjective):
        given = objective.direction is not None
        return objective.model_copy(update={"direction": given, "acceleration": None})
    return objective
