"""Objectives by the kind in a problem file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from copose.capability import ClosedChainVelocity, ExternalForce
from copose.cell.cell import Cell
from copose.objectives.acceleration import Acceleration
from copose.objectives.eigenvalues import Isotropy, WorstDirection
from copose.objectives.ellipsoid import TaskCompatibility, Volume
from copose.objectives.objective import Objective
from copose.objectives.payload import Payload
from copose.poses import Array
from copose.problem import Problem


def objective_of(cell: Cell) -> Objective:
    """The objective of a problem."""
    spec = cell.problem.objective
    return OBJECTIVES[spec.kind](cell, spec)


def _volume(cell: Cell, spec: Any) -> Objective:
    return Volume(spec.kind, "log", cell.resolution, cell.scales)


def _velocity_volume(cell: Cell, spec: Any) -> Objective:
    speeds = [np.ones(arm.n) for arm in cell.arms]
    return Volume(spec.kind, "log", ClosedChainVelocity(), speeds)


def _force_volume(cell: Cell, spec: Any) -> Objective:
    return Volume(spec.kind, "log", ExternalForce(), cell.scales)


def _worst_direction(cell: Cell, spec: Any) -> Objective:
    return WorstDirection(spec.kind, _axis_unit(cell.problem), cell.resolution, cell.scales)


def _isotropy(cell: Cell, spec: Any) -> Objective:
    return Isotropy(spec.kind, "1", cell.resolution, cell.scales)


def _task_compatibility(cell: Cell, spec: Any) -> Objective:
    directions = np.array([cell.problem.along(w.direction) for w in spec.directions])
    weights = np.array([w.weight for w in spec.directions])
    return TaskCompatibility(cell.resolution, cell.scales, directions, weights)


def _acceleration(cell: Cell, spec: Any) -> Objective:
    problem = cell.problem
    directions = np.array([_whole(problem, u) for u in spec.wanted])
    touched = np.flatnonzero(directions.any(axis=0)).tolist()
    unit = plain_unit(problem, touched)
    return Acceleration(unit, cell.torque_limits or (), directions, problem.space)


def _payload(cell: Cell, spec: Any) -> Objective:
    acceleration = np.zeros(cell.problem.space.m)
    if spec.direction is not None and spec.acceleration is not None:
        acceleration = spec.acceleration * _whole(cell.problem, spec.direction)
    return Payload(cell.torque_limits or (), acceleration, cell.problem.space)


def _all_round(cell: Cell, spec: Any) -> Objective:
    from copose.objectives.all_round import AllRound

    problem = cell.problem
    unit = plain_unit(problem, problem.axes)
    return AllRound(unit, cell.torque_limits or (), problem.axes, problem.space)


OBJECTIVES: dict[str, Callable[[Cell, Any], Objective]] = {
    "volume": _volume,
    "worst-direction": _worst_direction,
    "isotropy": _isotropy,
    "task-compatibility": _task_compatibility,
    "acceleration": _acceleration,
    "payload": _payload,
    "all-round": _all_round,
    "velocity-volume": _velocity_volume,
    "force-volume": _force_volume,
}


def _whole(problem: Problem, direction: tuple[float, ...]) -> Array:
    """A direction of the file as a unit vector over all coordinates of the task, (m,)."""
    whole = np.zeros(problem.space.m)
    whole[list(problem.axes)] = problem.along(direction)
    return whole


def _axis_unit(problem: Problem) -> str:
    """The unit of a semi-axis: per unit torque, or at the torque limits."""
    unit = plain_unit(problem, problem.axes)
    return unit if problem.ellipsoid.torque_scaling == "limits" else f"{unit} per N·m"


def plain_unit(problem: Problem, axes: Sequence[int]) -> str:
    """The unit of accelerations on some coordinates of the task."""
    linear = {"m/s²" for axis in axes if axis in problem.space.linear}
    angular = {"rad/s²" for axis in axes if axis in problem.space.angular}
    return ", ".join(sorted(linear) + sorted(angular))
