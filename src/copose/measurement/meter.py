"""Measurement of a posture from its joint positions alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from copose.capability import RESOLUTIONS, Ellipsoid, forward_dynamics
from copose.capability.torque_limits import Extreme
from copose.cell.cell import Cell
from copose.cell.dynamics import CellDynamics
from copose.cell.functions import PostureFunctions, ellipsoid_of, sliced
from copose.measurement.torque_limits import Allowances, TorqueLimitReport
from copose.measurement.velocity_force import Companions
from copose.objectives.objective import Objective
from copose.objectives.registry import objective_of
from copose.poses import Array, Pose
from copose.results import (
    ArmRecord,
    EllipsoidRecord,
    Posture,
    Vector,
    frame,
    matrix,
    place,
    vector,
)


@dataclass(frozen=True, eq=False)
class Measurement:
    """A measured posture and what kept numbers from existing.

    Attributes:
        posture: the record of a result.
        ellipsoid: the system's, None where its volume is zero.
        value: the objective's, None where there is none.
        notes: why numbers are missing.
        extremes: of what torque limits allow, by name.
    """

    posture: Posture
    ellipsoid: Ellipsoid | None
    value: float | None
    notes: tuple[str, ...]
    extremes: Mapping[str, Extreme]


@dataclass(frozen=True, eq=False)
class Measures:
    """Measured values of many postures; NaN where an arm is singular.

    Attributes:
        objective: the problem's, (count,).
        gram: G of the ellipsoid that the objective measures, (count, a, a); None where torque
            limits decide it.
        closure_error: by arm, the larger of a tip's position error, m, and angle error, rad, in the
            linear spaces the position error, (count,).
        share: of a torque limit, the largest at its least, with which arms at rest hold the object,
            (count,); None where ``static_torque`` does not ask for it.
    """

    objective: Array
    gram: Array | None
    closure_error: dict[str, Array]
    share: Array | None = None


class Meter:
    """Measures postures of one cell; built once, used for every number of a result.

    Attributes:
        objective: the problem's.
    """

    def __init__(
        self, cell: Cell, objective: Objective | None = None, capacity: CellDynamics | None = None
    ) -> None:
        """Build the functions that evaluate a posture.

        The objective and what torque limits allow may have been built already.
        """
        self._cell = cell
        self.objective = objective_of(cell) if objective is None else objective
        self._capacity = capacity
        system = cell.system
        place = system.parameters
        self._arms = [
            PostureFunctions(
                arm.q,
                place,
                [
                    *system.pose_error(i),
                    arm.J,
                    cell.resolution.own_factor(arm, scale),
                    arm.placements,
                ],
            )
            for i, (arm, scale) in enumerate(zip(system.arms, cell.scales, strict=True))
        ]
        gravity, velocity = ca.SX.sym("gravity", 3), ca.SX.sym("velocity", system.space.m)
        self._factors = PostureFunctions(
            system.q, place, [kind.factor(system, cell.scales) for kind in RESOLUTIONS.values()]
        )
        self._center = PostureFunctions(
            system.q,
            ca.vertcat(place, gravity, velocity),
            [forward_dynamics(system, gravity, velocity)[1]],
        )
        self._own_factor = None
        form = self.objective.form
        if form is not None and form is not cell.resolution:
            factor = form.factor(system, self.objective.scales)
            self._own_factor = PostureFunctions(system.q, place, [factor])

    def toward(self, objective: Objective) -> Meter:
        """A meter for another objective of the same kind."""
        if objective is self.objective:
            return self
        meter = copy(self)
        meter.objective = objective
        return meter

    @property
    def _allowance(self) -> TorqueLimitReport | None:
        """None where a joint has no torque limit."""
        capacity = self._limited
        return None if capacity is None else TorqueLimitReport(self._cell, self.objective, capacity)

    @cached_property
    def _limited(self) -> CellDynamics | None:
        """The equations of motion; None where a joint has no torque limit."""
        limits = self._cell.torque_limits
        if limits is None or self._capacity is not None:
            return None if limits is None else self._capacity
        return CellDynamics(self._cell, limits)

    @cached_property
    def _companions(self) -> Companions:
        return Companions(self._cell)

    def measure(
        self, cell: Cell, joints: Sequence[Array], *, everything: bool = False
    ) -> Measurement:
        """The ellipsoids, closure and skeletons of a posture, by arm (n_i,), and what limits allow;
        with ``everything`` also what the problem does not ask for.
        """
        pose = cell.problem.object.pose
        errors, records, notes = self._by_arm(cell, joints, pose)
        ellipsoids: dict[str, Ellipsoid | None] = dict.fromkeys(RESOLUTIONS)
        closed = not notes
        if closed and not cell.weightless:
            whole = self._ellipsoids(cell, joints)
            notes += _ellipsoid_notes(whole)
            ellipsoids = {name: sliced(cell, each) for name, each in whole.items()}
        ellipsoid = ellipsoids[cell.resolution.name]
        allowed = self._allowed(cell, joints, everything)
        notes += allowed.notes
        planar = cell.problem.space.planar
        keys: dict[str, Any] = {
            what: {
                arm.name: frame(getattr(arm, what), planar) for arm in cell.arms if what in arm.free
            }
            for what in ("base", "grasp")
        }
        posture = Posture(
            joints={arm.name: vector(q) for arm, q in zip(cell.arms, joints, strict=True)},
            object=place(pose, planar),
            closure_error=errors,
            ellipsoid=EllipsoidRecord.of(ellipsoid),
            log_volumes={
                name: each.log_volume if each is not None else None
                for name, each in ellipsoids.items()
            },
            arms=records,
            **{key: value for key, value in keys.items() if value},
            **allowed.keys,
        )
        value = allowed.value
        if self.objective.form is not None and closed:
            measured = ellipsoid
            if self._own_factor is not None:
                (factor,) = self._own_factor(np.concatenate(joints), cell.parameters)
                measured = sliced(cell, ellipsoid_of(factor))
            value = None if measured is None else self.objective.of(measured)
        return Measurement(posture, ellipsoid, value, tuple(notes), allowed.extremes)

    def _by_arm(
        self, cell: Cell, joints: Sequence[Array], pose: Pose
    ) -> tuple[dict[str, float], dict[str, ArmRecord], list[str]]:
        """Closure errors, skeletons and ellipsoids by arm, and notes on arms that are singular."""
        space = cell.system.space
        errors, records, notes = {}, {}, []
        for arm, function, q in zip(cell.arms, self._arms, joints, strict=True):
            gap, turn, J, own, placements = function(q, cell.parameters)
            errors[arm.name] = float(
                closure_errors(gap[list(space.linear)].T, turn.T, space.rigid)[0]
            )
            rank = _rank(J)
            if rank < space.m:
                notes.append(
                    f"volume 0: the Jacobian of arm {arm.name!r} has rank {rank} of {space.m} "
                    "here; another posture, or [objective] axes that it can move along, has a "
                    "volume"
                )
            known = rank == space.m and arm.name not in cell.weightless
            records[arm.name] = ArmRecord(
                skeleton=matrix(placements[:3].T),
                quaternions=matrix(placements[3:].T),
                grasp=vector((pose @ arm.grasp).position),
                ellipsoid=EllipsoidRecord.of(ellipsoid_of(own) if known else None),
            )
        return errors, records, notes

    def _allowed(self, cell: Cell, joints: Sequence[Array], everything: bool) -> Allowances:
        asks = self.objective.torque_limited or cell.problem.constraints.static_torque
        # Built only for what is stated.
        allowance = self._allowance if everything or asks else None
        if not everything:
            return Allowances(cell) if allowance is None else allowance.asked(cell, joints)
        allowances = Allowances.unknown(cell) if allowance is None else allowance.all(cell, joints)
        allowances.keys["companions"] = self._companions.of(cell, joints)
        return allowances

    def holding_shares(self, cell: Cell, joints: Sequence[Array]) -> dict[str, Vector] | None:
        """Share of each joint's torque limit, by arm, in the hold at rest whose largest share is
        smallest; None where a joint has no limit or no contact wrenches hold the object.
        """
        allowance = self._allowance
        return None if allowance is None else allowance.holding(cell, joints)

    def _ellipsoids(self, cell: Cell, joints: Sequence[Array]) -> dict[str, Ellipsoid | None]:
        """The system's ellipsoid by each resolution, in all coordinates of the task."""
        q = np.concatenate(joints)
        factors = self._factors(q, cell.parameters)
        center = np.zeros(cell.system.space.m)
        if np.any(cell.gravity) or np.any(cell.velocity):
            moving = np.concatenate([cell.parameters, cell.gravity, cell.velocity])
            center = self._center(q, moving)[0].ravel()
        return {
            name: ellipsoid_of(factor, center)
            for name, factor in zip(RESOLUTIONS, factors, strict=True)
        }


def closure_errors(gap: Array, turn: Array, rigid: bool) -> Array:
    """The larger of position error, m, and angle error θ = 2 atan2(|v|, |w|), rad; (count,).

    Args:
        gap: position errors, (count, 3 or 2).
        turn: quaternions of the angle errors, (count, 4).
        rigid: whether the angle counts.
    """
    distance = np.linalg.norm(gap, axis=1)
    angle = 2 * np.arctan2(np.linalg.norm(turn[:, 1:], axis=1), np.abs(turn[:, 0]))
    return np.asarray(np.maximum(distance, angle) if rigid else distance)


def _ellipsoid_notes(whole: Mapping[str, Ellipsoid | None]) -> list[str]:
    """Notes on ellipsoids by resolution, in all coordinates of the task."""
    notes = []
    if any(each is None for each in whole.values()):
        notes.append(
            "volume unknown: the equations of motion are singular to working precision; another "
            "posture, or inertia and armature as they are, has one"
        )
    # Whether the object can be kept at rest is a question for all of its coordinates, and not for
    # least-norm rules.
    optimal = whole["torque-optimal"]
    if optimal is not None and not optimal.contains(np.zeros(len(optimal.center))):
        notes.append(
            "rest is outside the shifted ellipsoid: torques of the ball cannot keep the object "
            "from accelerating (copose manual measures)"
        )
    return notes


def _rank(J: Array) -> int:
    values = np.linalg.svd(J, compute_uv=False)
    # Nothing that a pseudoinverse says of a direction below would be known to a single digit.
    return int(np.sum(values > 1e-12 * max(values[0], 1e-300)))
