"""Extremes that torque limits allow at one posture, as a result states them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from copose.capability import Ellipsoid, ExactSet
from copose.capability.torque_limits import Dynamics, Extreme
from copose.cell.cell import Cell
from copose.cell.dynamics import HELD, CellDynamics
from copose.objectives.objective import Objective
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


class TorqueLimitReport:
    """A reporter of what the torque limits of a cell allow at its postures; built once.

    Attributes:
        capacity: evaluates the equations of motion.
        objective: the problem's.
    """

    def __init__(self, cell: Cell, objective: Objective, capacity: CellDynamics) -> None:
        """For one cell."""
        self.capacity, self.objective = capacity, objective
        self._static = cell.problem.constraints.static_torque

    def asked(self, cell: Cell, q: Sequence[Array]) -> Allowances:
        """Extremes that the problem asks for, of a posture by arm, (n_i,)."""
        allowances = self._with_objective(cell, q)
        if self._static or self.objective.torque_limited:
            allowances.hold(needed=self._static)
        return allowances

    def all(self, cell: Cell, q: Sequence[Array]) -> Allowances:
        """Everything, of a posture by arm, (n_i,)."""
        allowances, space = self._with_objective(cell, q), cell.system.space
        allowances.hold(needed=self._static)
        if "payload" not in allowances.keys:
            allowances.payload(np.zeros(space.m))
        for axis in cell.problem.axes:
            for sign, word in ((1.0, "+"), (-1.0, "−")):
                u = np.zeros(space.m)
                u[axis] = sign
                allowances.acceleration(u, f"acceleration {word}{space.coordinates[axis]}")
        allowances.exact_sets()
        return allowances

    def holding(self, cell: Cell, q: Sequence[Array]) -> dict[str, Vector] | None:
        """Shares of the torque limits in the hold at rest whose largest share is smallest, by arm;
        None where no contact wrenches hold the object.
        """
        holding = self.capacity.holding(cell)
        extreme = self.capacity.dynamics(holding, [q_arm[None] for q_arm in q]).hold(holding.hold)
        return None if extreme is None else shares_of(cell, self.capacity, extreme)

    def _with_objective(self, cell: Cell, q: Sequence[Array]) -> Allowances:
        allowances, objective = Allowances(cell, self.capacity, q), self.objective
        if objective.torque_limited:
            allowances.value = objective.report(allowances)
            if allowances.value is None:
                allowances.notes.append(
                    f"no {objective.kind}: the torque limits leave no such motion of the object "
                    "here"
                )
        return allowances


class Allowances:
    """Extremes that torque limits allow at one posture, grown by what is asked for.

    Attributes:
        keys: parts of the posture's record.
        value: the objective's, where limits decide it.
        notes: what is unknown, and why.
        extremes: by name.
    """

    def __init__(
        self, cell: Cell, capacity: CellDynamics | None = None, q: Sequence[Array] = ()
    ) -> None:
        """Nothing asked for yet of a posture, by arm (n_i,); without a capacity nothing can be."""
        self.keys: dict[str, Any] = {}
        self.value: float | None = None
        self.notes: list[str] = []
        self.extremes: dict[str, Extreme] = {}
        self._cell, self._q = cell, q
        if capacity is not None:
            self._capacity, self._holding = capacity, capacity.holding(cell)
            self._dynamics: Dynamics = capacity.dynamics(self._holding, [part[None] for part in q])

    @classmethod
    def unknown(cls, cell: Cell) -> Allowances:
        """The statement on a cell some of whose joints have no torque limit."""
        allowances = cls(cell)
        parts = "torque_shares", "wrenches", "joint_accelerations"
        for key in ("payload", "static_torque", "residual_radius", *parts):
            allowances.keys[key] = None
        if not cell.weightless:
            allowances.notes.append(
                "what torque limits allow is unknown: every joint needs [[arms]] torque_limits"
            )
        return allowances

    def acceleration(self, direction: Array, name: str) -> float | None:
        """State the largest acceleration along a unit direction, (m,); None where there is none."""
        extreme = self._dynamics.extreme(self._holding.acceleration(direction))
        self._state(name, extreme)
        value = None if extreme is None else extreme.value
        record = AccelerationRecord(direction=vector(direction), value=value)
        self.keys["accelerations"] = (*self.keys.get("accelerations", ()), record)
        return value

    def payload(self, acceleration: Array) -> float | None:
        """State the largest mass, kg, accelerated so, (m,), or held at rest."""
        value = None
        if np.any(self._cell.system.gravity):
            extreme = self._dynamics.extreme(self._holding.payload(acceleration))
            self._state("payload", extreme, moving=bool(np.any(acceleration)))
            value = None if extreme is None else extreme.value
            if extreme is None:
                self.notes.append("payload unknown: no mass can be held here, or any mass")
            elif extreme.value < 0:
                self.notes.append("payload below zero: the arms cannot hold even themselves here")
        else:
            self.notes.append("no payload: [world] gravity is 0")
        self.keys["payload"] = value
        return value

    def radius(self, axes: Sequence[int]) -> float | None:
        """State the largest ball of accelerations around rest on some axes."""
        exact, value = self._capacity.exact_set(self._cell, self._q, axes), None
        if exact is None:
            self.notes.append("residual_radius unknown: the equations of motion are singular")
        else:
            value = exact.residual_radius
            self._touching(exact)
        self.keys["residual_radius"] = value
        return value

    def hold(self, *, needed: bool) -> None:
        """State the hold at rest whose largest share of a torque limit is smallest.

        Args:
            needed: whether it has to be within the limits.
        """
        extreme = self._dynamics.hold(self._holding.hold)
        self._state("hold", extreme, moving=False)
        if extreme is None:
            self.keys["static_torque"] = None
            self.notes.append("no contact wrenches within their limits hold the object here")
            return
        if needed and extreme.value > 1 + HELD:
            self.notes.append(
                f"the object cannot be held at rest: that takes {extreme.value:.3g} times a torque "
                "limit"
            )
        self.keys["static_torque"] = shares_of(self._cell, self._capacity, extreme)

    def exact_sets(self) -> None:
        """State the exact sets of linear and of angular accelerations."""
        cell = self._cell
        space, records = cell.system.space, {}
        for name, kind in (("linear", space.linear), ("angular", space.angular)):
            axes = [axis for axis in cell.problem.axes if axis in kind]
            exact = self._capacity.exact_set(cell, self._q, axes) if axes else None
            if exact is not None:
                self._touching(exact)
                ball = Ellipsoid.from_factor(np.linalg.pinv(exact.generators), exact.center)
                records[name] = ExactSetRecord(
                    ellipsoid=EllipsoidRecord.of(ball.section(axes)),
                    axes=tuple(space.coordinates[axis] for axis in axes),
                    vertices=matrix(exact.vertices.reshape(-1, len(axes))),
                    residual_radius=exact.residual_radius,
                )
        if not records:
            self.notes.append(
                "exact set unknown: the equations of motion are singular here; another posture has "
                "one"
            )
        self.keys["exact_sets"] = records
        one = len(records) == 1
        radius = next(iter(records.values())).residual_radius if one else None
        if len(records) > 1:
            self.notes.append("residual radii are linear and angular apart: see exact_sets")
        self.keys["residual_radius"] = radius

    def _touching(self, exact: ExactSet) -> None:
        """State the extreme that limits the ball around rest in an exact set."""
        space, u = self._cell.system.space, np.zeros(self._cell.system.space.m)
        if exact.weakest is None:
            return
        u[list(exact.axes)] = exact.weakest
        free, q = self._holding.forces_alone, [part[None] for part in self._q]
        extreme = self._capacity.dynamics(free, q, bounded=False).extreme(free.acceleration(u))
        if extreme is not None:
            kind = "linear" if exact.axes[0] in space.linear else "angular"
            name = f"residual radius, {kind}"
            self._state_shares(name, extreme)
            self._state_motion(name, extreme)

    def _state(self, name: str, extreme: Extreme | None, *, moving: bool = True) -> None:
        """State the contact wrenches of an extreme, in world axes, with their internal parts, its
        shares of torque limits, and its joint accelerations where joints move.
        """
        if extreme is None:
            return
        self.extremes[name] = extreme
        if name != "hold":
            self._state_shares(name, extreme)
        if moving:
            self._state_motion(name, extreme)
        arms, holding = self._cell.arms, self._holding
        m = self._cell.system.space.m
        grasps = [P[:m] @ R.T for P, R in zip(holding.balance, holding.turns, strict=True)]
        wrenches = [R @ h for R, h in zip(holding.turns, extreme.wrenches, strict=True)]
        total = np.sum([W @ h for W, h in zip(grasps, wrenches, strict=True)], axis=0)
        self.keys.setdefault("wrenches", {})[name] = {
            arm.name: WrenchRecord(
                wrench=vector(h), internal=vector(h - np.linalg.solve(W, total) / len(arms))
            )
            for arm, h, W in zip(arms, wrenches, grasps, strict=True)
        }

    def _state_shares(self, name: str, extreme: Extreme) -> None:
        shares = shares_of(self._cell, self._capacity, extreme)
        self.keys.setdefault("torque_shares", {})[name] = shares

    def _state_motion(self, name: str, extreme: Extreme) -> None:
        self.extremes[name] = extreme
        accelerations = zip(self._cell.arms, extreme.accelerations, strict=True)
        self.keys.setdefault("joint_accelerations", {})[name] = {
            arm.name: vector(part) for arm, part in accelerations
        }


def shares_of(cell: Cell, capacity: CellDynamics, extreme: Extreme) -> dict[str, Vector]:
    """Shares of each joint's torque limit in an extreme, by arm."""
    shares = zip(cell.arms, extreme.torques, capacity.limits, strict=True)
    return {arm.name: vector(np.abs(t) / T) for arm, t, T in shares}
