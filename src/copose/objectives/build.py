"""From what a problem file asks for to an objective."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from copose.capability import ClosedChainVelocity, ExternalForce
from copose.cell.cell import Cell
from copose.objectives.ellipsoid_measures import (
    Isotropy,
    Objective,
    TaskCompatibility,
    Volume,
    WorstDirection,
)
from copose.objectives.limits_measures import Acceleration, AllRound, Payload
from copose.poses import Array
from copose.problem import (
    AccelerationObjective,
    PayloadObjective,
    Problem,
    TaskCompatibilityObjective,
)


def objective_of(cell: Cell) -> Objective:
    """The objective of a problem."""
    problem, spec = cell.problem, cell.problem.objective
    form, scales, limits = cell.resolution, cell.scales, cell.torque_limits or ()
    if isinstance(spec, TaskCompatibilityObjective):
        directions = np.array([problem.along(w.direction) for w in spec.directions])
        weights = np.array([w.weight for w in spec.directions])
        return TaskCompatibility(form, scales, directions, weights)
    if isinstance(spec, AccelerationObjective):
        directions = np.array([_whole(problem, u) for u in spec.wanted])
        touched = np.flatnonzero(directions.any(axis=0)).tolist()
        return Acceleration(plain_unit(problem, touched), limits, directions, problem.space)
    if isinstance(spec, PayloadObjective):
        wanted = np.zeros(problem.space.m)
        if spec.direction is not None and spec.acceleration is not None:
            wanted = spec.acceleration * _whole(problem, spec.direction)
        return Payload(limits, wanted, problem.space)
    if spec.kind == "all-round":
        return AllRound(plain_unit(problem, problem.axes), limits, problem.axes, problem.space)
    if spec.kind == "velocity-volume":
        speeds = [np.ones(arm.n) for arm in cell.arms]
        return Volume(spec.kind, "log", ClosedChainVelocity(), speeds)
    if spec.kind == "force-volume":
        return Volume(spec.kind, "log", ExternalForce(), scales)
    if spec.kind == "worst-direction":
        return WorstDirection(spec.kind, acceleration_unit(problem), form, scales)
    if spec.kind == "isotropy":
        return Isotropy(spec.kind, "1", form, scales)
    return Volume(spec.kind, "log", form, scales)


def _whole(problem: Problem, direction: tuple[float, ...]) -> Array:
    """A direction of the file as a unit vector over all coordinates of the task, (m,)."""
    whole = np.zeros(problem.space.m)
    whole[list(problem.axes)] = problem.along(direction)
    return whole


def acceleration_unit(problem: Problem) -> str:
    """The unit of a semi-axis: per unit torque, or at the torque limits."""
    unit = plain_unit(problem, problem.axes)
    return unit if problem.ellipsoid.torque_scaling == "limits" else f"{unit} per N·m"


def plain_unit(problem: Problem, axes: Sequence[int]) -> str:
    """The unit of accelerations on some coordinates of the task."""
    linear = {"m/s²" for axis in axes if axis in problem.space.linear}
    angular = {"rad/s²" for axis in axes if axis in problem.space.angular}
    return ", ".join(sorted(linear) + sorted(angular))
