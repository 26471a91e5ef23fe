"""Torques within their limits while the object is held at rest, as a constraint on postures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import casadi as ca
import numpy as np

from copose.capability import HoldingTorque
from copose.capability.torque_limits import JointMotion
from copose.cell.cell import Cell
from copose.cell.context import PostureContext
from copose.cell.dynamics import HELD, CellDynamics
from copose.constraints.constraint import ConstraintTerm
from copose.constraints.posture_constraint import PostureConstraint
from copose.constraints.torque import demand_term
from copose.mechanics import System
from copose.poses import Array, Mask
from copose.results import Posture


class StaticTorque(PostureConstraint):
    """Some contact wrenches hold the object at rest with no torque beyond its limit."""

    name = "hold"
    torque_limited = True
    sums = HoldingTorque()

    @classmethod
    def of(cls, cell: Cell, *, moving: bool) -> Self | None:
        """The constraint by ``static_torque``; also at both ends of the shortest motion."""
        asked = cell.held_knots(2).any() if moving else cell.problem.constraints.static_torque
        return cls() if asked else None

    def shares(self, context: PostureContext, q: Sequence[Array]) -> Array:
        """The largest share of a torque limit, at its least, with which postures, by arm
        (count, n_i), hold the object, (count,).
        """
        return context.dynamics(q).shares(context.loaded[1].hold)

    def allows(self, context: PostureContext, q: Sequence[Array]) -> Mask:
        """A mask of those with no share beyond 1."""
        return np.asarray(self.shares(context, q) <= 1 + HELD)

    def certainly_broken(self, sums: ca.SX, weight: ca.SX, n_joints: int) -> ca.SX:
        """The least norm of shares is beyond that of torques that are all at their limits."""
        broken: ca.SX = HoldingTorque.norm(sums, weight) > n_joints**0.5
        return broken

    def term(self, system: System, capacity: CellDynamics | None) -> ConstraintTerm:
        """Contact wrenches that hold the object; over typical sizes they are the variables,
        stacked, see `CellDynamics.resting`.
        """
        assert capacity is not None
        b, fall = len(system.space.balance), system.gravity
        rows = 2 if system.space.planar else 3
        weight = -system.object.mass * ca.DM(fall[:rows])
        load, rest = ca.vertcat(weight, ca.SX(b - rows, 1)), ca.SX(system.space.m, 1)
        variables, constraints = demand_term(
            system, rest, load, JointMotion.REST, capacity, capacity.bounds, " that hold the object"
        )
        return ConstraintTerm(ca.vertcat(*variables), tuple(constraints))

    def starts(self, context: PostureContext, q: Sequence[Array]) -> Array:
        """Wrenches of the hold whose largest share is smallest."""
        capacity, holding = context.loaded
        return capacity.resting(holding, q)

    def kept(self, posture: Posture) -> bool:
        """True where no share is beyond 1 in the measured hold."""
        shares = posture.static_torque
        return shares is not None and max(map(max, shares.values())) <= 1 + HELD
