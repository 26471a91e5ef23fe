"""What torque limits allow at one posture, as a result states it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from copose.capability import Ellipsoid, ExactSet
from copose.capability.torque_limits import Dynamics, Extreme
from copose.cell.cell import Cell
from copose.cell.dynamics import HELD, CellDynamics, Holding
from copose.objectives.ellipsoid_measures import Objective
from copose.objectives.limits_measures import Acceleration, AllRound, LimitsMeasure, Payload
from copose.poses import Array
from copose.results import (
    AccelerationRecord,
    EllipsoidRecord,
    ExactSetRecord,
    Vector,
    WrenchRecord,
    matrix,
    vector,
)


@dataclass(eq=False)
class Allowances:
    """Parts of a posture's record, with the objective's value where limits decide it, notes, and
    the extremes by name.
    """

    keys: dict[str, Any] = field(default_factory=dict)
    value: float | None = None
    notes: list[str] = field(default_factory=list)
    extremes: dict[str, Extreme] = field(default_factory=dict)


class TorqueLimitReport:
    """States what the torque limits of a cell allow at its postures; built once.

    Attributes:
        capacity: evaluates the equations of motion.
        objective: the problem's.
    """

    def __init__(self, cell: Cell, objective: Objective, capacity: CellDynamics) -> None:
        """For one cell."""
        self.capacity, self.objective = capacity, objective
        self._static = cell.problem.constraints.static_torque

    def asked(self, cell: Cell, q: Sequence[Array]) -> Allowances:
        """What the problem asks for, of a posture by arm, (n_i,)."""
        holding, found = self.capacity.holding(cell), Allowances()
        objective = self.objective
        if isinstance(objective, LimitsMeasure):
            self._objective(cell, holding, objective, q, found)
        if self._static or isinstance(objective, LimitsMeasure):
            self._hold(cell, holding, self._dynamics(holding, q), found)
        return found

    def all(self, cell: Cell, q: Sequence[Array]) -> Allowances:
        """Everything, of a posture by arm, (n_i,)."""
        holding, found = self.capacity.holding(cell), Allowances()
        dynamics = self._dynamics(holding, q)
        objective, space = self.objective, cell.system.space
        if isinstance(objective, LimitsMeasure):
            self._objective(cell, holding, objective, q, found)
        self._hold(cell, holding, dynamics, found)
        if not isinstance(objective, Payload):
            self._payload(cell, holding, dynamics, np.zeros(space.m), found)
        records = list(found.keys.get("accelerations", ()))
        for axis in cell.problem.axes:
            for sign, word in ((1.0, "+"), (-1.0, "−")):
                u = np.zeros(space.m)
                u[axis] = sign
                name = f"acceleration {word}{space.coordinates[axis]}"
                records.append(self._acceleration(cell, holding, dynamics, u, name, found))
        found.keys["accelerations"] = tuple(records)
        self._exact_sets(cell, holding, q, found)
        return found

    def holding(self, cell: Cell, q: Sequence[Array]) -> dict[str, Vector] | None:
        """Shares of the torque limits in the hold at rest whose largest share is smallest, by arm;
        None where no contact wrenches hold the object.
        """
        holding = self.capacity.holding(cell)
        extreme = self._dynamics(holding, q).hold(holding.hold)
        return None if extreme is None else self._shares(cell, extreme)

    def _dynamics(self, holding: Holding, q: Sequence[Array]) -> Dynamics:
        return self.capacity.dynamics(holding, [mine[None] for mine in q])

    def _objective(
        self,
        cell: Cell,
        holding: Holding,
        objective: LimitsMeasure,
        q: Sequence[Array],
        found: Allowances,
    ) -> None:
        dynamics = self._dynamics(holding, q)
        if isinstance(objective, Acceleration):
            names = ["acceleration"]
            if len(objective.directions) > 1:
                names = [f"acceleration {k + 1}" for k in range(len(objective.directions))]
            records = [
                self._acceleration(cell, holding, dynamics, u, name, found)
                for u, name in zip(objective.directions, names, strict=True)
            ]
            found.keys["accelerations"] = tuple(records)
            values = [record.value for record in records if record.value is not None]
            found.value = min(values) if len(values) == len(records) else None
        elif isinstance(objective, Payload):
            found.value = self._payload(cell, holding, dynamics, objective.acceleration, found)
        elif isinstance(objective, AllRound):
            exact = self.capacity.exact_set(cell, q, objective.axes)
            if exact is None:
                found.notes.append("residual_radius unknown: the equations of motion are singular")
            else:
                found.value = exact.residual_radius
                self._touching(cell, holding, q, exact, found)
            found.keys["residual_radius"] = found.value
        if found.value is None:
            found.notes.append(
                f"no {objective.kind}: the torque limits leave no such motion of the object here"
            )

    def _acceleration(
        self,
        cell: Cell,
        holding: Holding,
        dynamics: Dynamics,
        u: Array,
        name: str,
        found: Allowances,
    ) -> AccelerationRecord:
        extreme = dynamics.extreme(holding.acceleration(u))
        self._state(cell, holding, name, extreme, found)
        value = None if extreme is None else extreme.value
        return AccelerationRecord(direction=vector(u), value=value)

    def _payload(
        self,
        cell: Cell,
        holding: Holding,
        dynamics: Dynamics,
        acceleration: Array,
        found: Allowances,
    ) -> float | None:
        value = None
        if np.any(cell.system.gravity):
            extreme = dynamics.extreme(holding.payload(acceleration))
            moving = bool(np.any(acceleration))
            self._state(cell, holding, "payload", extreme, found, moving=moving)
            value = None if extreme is None else extreme.value
            if extreme is None:
                found.notes.append("payload unknown: no mass can be held here, or any mass")
            elif extreme.value < 0:
                found.notes.append("payload below zero: the arms cannot hold even themselves here")
        else:
            found.notes.append("no payload: [world] gravity is 0")
        found.keys["payload"] = value
        return value

    def _hold(self, cell: Cell, holding: Holding, dynamics: Dynamics, found: Allowances) -> None:
        extreme = dynamics.hold(holding.hold)
        self._state(cell, holding, "hold", extreme, found, moving=False)
        if extreme is None:
            found.keys["static_torque"] = None
            found.notes.append("no contact wrenches within their limits hold the object here")
            return
        if self._static and extreme.value > 1 + HELD:
            found.notes.append(
                f"the object cannot be held at rest: that takes {extreme.value:.3g} times a torque "
                "limit"
            )
        found.keys["static_torque"] = self._shares(cell, extreme)

    def _exact_sets(
        self, cell: Cell, holding: Holding, q: Sequence[Array], found: Allowances
    ) -> None:
        space, records = cell.system.space, {}
        for name, kind in (("linear", space.linear), ("angular", space.angular)):
            axes = [axis for axis in cell.problem.axes if axis in kind]
            exact = self.capacity.exact_set(cell, q, axes) if axes else None
            if exact is not None:
                self._touching(cell, holding, q, exact, found)
                ball = Ellipsoid.from_factor(np.linalg.pinv(exact.generators), exact.center)
                records[name] = ExactSetRecord(
                    ellipsoid=EllipsoidRecord.of(ball.section(axes)),
                    axes=tuple(space.coordinates[axis] for axis in axes),
                    vertices=matrix(exact.vertices.reshape(-1, len(axes))),
                    residual_radius=exact.residual_radius,
                )
        if not records:
            found.notes.append(
                "exact set unknown: the equations of motion are singular here; another posture has "
                "one"
            )
        found.keys["exact_sets"] = records
        one = len(records) == 1
        radius = next(iter(records.values())).residual_radius if one else None
        if len(records) > 1:
            found.notes.append("residual radii are linear and angular apart: see exact_sets")
        found.keys["residual_radius"] = radius

    def _touching(
        self,
        cell: Cell,
        holding: Holding,
        q: Sequence[Array],
        exact: ExactSet,
        found: Allowances,
    ) -> None:
        """The extreme that limits the ball around rest in an exact set."""
        space, u = cell.system.space, np.zeros(cell.system.space.m)
        if exact.weakest is None:
            return
        u[list(exact.axes)] = exact.weakest
        free = holding.forces_alone
        dynamics = self.capacity.dynamics(free, [mine[None] for mine in q], bounded=False)
        extreme = dynamics.extreme(free.acceleration(u))
        if extreme is not None:
            kind = "linear" if exact.axes[0] in space.linear else "angular"
            name = f"residual radius, {kind}"
            found.keys.setdefault("torque_shares", {})[name] = self._shares(cell, extreme)
            self._moved(cell, name, extreme, found)

    def _state(
        self,
        cell: Cell,
        holding: Holding,
        name: str,
        extreme: Extreme | None,
        found: Allowances,
        *,
        moving: bool = True,
    ) -> None:
        """The contact wrenches of an extreme, in world axes, with their internal parts, its
        shares of torque limits, and its joint accelerations where joints move.
        """
        if extreme is None:
            return
        found.extremes[name] = extreme
        if name != "hold":
            found.keys.setdefault("torque_shares", {})[name] = self._shares(cell, extreme)
        if moving:
            self._moved(cell, name, extreme, found)
        K, m = len(cell.arms), cell.system.space.m
        grasps = [P[:m] @ R.T for P, R in zip(holding.balance, holding.turns, strict=True)]
        wrenches = [R @ h for R, h in zip(holding.turns, extreme.wrenches, strict=True)]
        total = np.sum([W @ h for W, h in zip(grasps, wrenches, strict=True)], axis=0)
        found.keys.setdefault("wrenches", {})[name] = {
            arm.name: WrenchRecord(
                wrench=vector(h), internal=vector(h - np.linalg.solve(W, total) / K)
            )
            for arm, h, W in zip(cell.arms, wrenches, grasps, strict=True)
        }

    def _shares(self, cell: Cell, extreme: Extreme) -> dict[str, Vector]:
        """Of each joint's torque limit, by arm."""
        shares = zip(cell.arms, extreme.torques, self.capacity.limits, strict=True)
        return {arm.name: vector(np.abs(t) / T) for arm, t, T in shares}

    def _moved(self, cell: Cell, name: str, extreme: Extreme, found: Allowances) -> None:
        found.extremes[name] = extreme
        accelerations = zip(cell.arms, extreme.accelerations, strict=True)
        found.keys.setdefault("joint_accelerations", {})[name] = {
            arm.name: vector(part) for arm, part in accelerations
        }
