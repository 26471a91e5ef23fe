"""What torque limits add to the posture program: variables, equations and bounds.

Joint accelerations and contact wrenches are variables of their own, so that torques are simple
expressions and nothing is inverted.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from copose.capability.contact_limits import WrenchBounds
from copose.capability.torque_limits import JointMotion
from copose.cell.dynamics import CellDynamics
from copose.constraints.constraint import Constraint, equality
from copose.mechanics import System
from copose.objectives.limits_measures import LimitsMeasure


@dataclass(frozen=True, eq=False)
class Addition:
    """Variables and constraints that join a program.

    Attributes:
        variables: stacked.
        constraints: on them and on the joints.
        value: what they make of an objective, None where they are a constraint alone.
        size: a typical one of the value.
    """

    variables: ca.SX
    constraints: tuple[Constraint, ...]
    value: ca.SX | None = None
    size: float = 1.0


def limits_addition(
    system: System,
    objective: LimitsMeasure,
    numbers: ca.SX,
    capacity: CellDynamics,
    turned: ca.SX | None = None,
) -> Addition:
    """The least t of an objective's demands.

    Variables are those of each demand, t first, see `_demand`; with several demands the last
    variable is the least t. All are over typical sizes, see `LimitsMeasure.starts`.

    Args:
        system: the expressions.
        objective: whose demands they are.
        numbers: the demands, as `LimitsMeasure.parted` takes them.
        capacity: bounds on contact wrenches, and sizes.
        turned: by how much M_o differs from that for which the demands are told, (m, m).
    """
    bounds = capacity.bounds if objective.balanced else capacity.bounds.none
    size = objective.size(capacity)
    reached, variables, constraints = [], [], []
    for k, (motion, load) in enumerate(objective.parted(numbers)):
        name = "" if objective.programmed == 1 else f" of demand {k + 1}"
        t = ca.SX.sym("t")
        if turned is not None:
            more_load = turned @ objective.carried(motion, system.object.mass)
            load += ca.vertcat(more_load, ca.SX(load.shape[0] - more_load.shape[0], 2))
        given = ca.vertcat(1, size * t)
        own, more = _demand(
            system, motion @ given, load @ given, objective.joints, capacity, bounds, name
        )
        reached.append(t)
        variables += [t, *own]
        constraints += more
    if objective.programmed == 1:
        return Addition(ca.vertcat(*variables), tuple(constraints), size * reached[0], size)
    least = ca.SX.sym("least")
    ahead = ca.vertcat(*(t - least for t in reached))
    above = Constraint(
        "least of the demands", ahead, np.zeros(len(reached)), np.full(len(reached), np.inf), "1"
    )
    return Addition(ca.vertcat(*variables, least), (*constraints, above), size * least, size)


def holding_addition(system: System, capacity: CellDynamics) -> Addition:
    """Some contact wrenches hold the object at rest; over typical sizes they are the variables,
    stacked, see `CellDynamics.resting`.
    """
    b, fall = len(system.space.balance), system.gravity
    rows = 2 if system.space.planar else 3
    weight = -system.object.mass * ca.DM(fall[:rows])
    load, rest = ca.vertcat(weight, ca.SX(b - rows, 1)), ca.SX(system.space.m, 1)
    variables, constraints = _demand(
        system, rest, load, JointMotion.REST, capacity, capacity.bounds, " that hold the object"
    )
    return Addition(ca.vertcat(*variables), tuple(constraints))


def _demand(
    system: System,
    motion: ca.SX,
    load: ca.SX,
    joints: JointMotion,
    capacity: CellDynamics,
    bounds: WrenchBounds,
    name: str,
) -> tuple[list[ca.SX], list[Constraint]]:
    """Variables and constraints of an acceleration of the object, (m,), and a load, (b,).

    Variables are the joint accelerations q̈ of all arms, y with q̈ = Jᵀy where they are the
    least-norm ones, and none at rest; then the contact wrenches.
    """
    rows = list(range(load.shape[0]))
    moving, wrenches, moved, shares, balance = [], [], [], [], -load
    sizes = zip(*capacity.sizes, strict=True)
    for i, (arm, T, (fast, strong)) in enumerate(
        zip(system.arms, capacity.limits, sizes, strict=True)
    ):
        coupling = system.coupling(i)
        h = ca.SX.sym(f"h_{arm.arm.name}", system.space.m)
        q_ddot = ca.SX(arm.arm.n, 1)
        if joints is not JointMotion.REST:
            free = joints is JointMotion.FREE
            own = ca.SX.sym(f"qdd_{arm.arm.name}", arm.arm.n if free else system.space.m)
            q_ddot = fast * (own if free else arm.J_root.T @ own)
            moving.append(own)
        torque, reached = arm.driven(q_ddot, coupling.fall, strong * h)
        moved.append((reached - coupling.motion @ motion) / fast)
        balance += coupling.balance[rows, :] @ (strong * h)
        wrenches.append(h)
        shares.append(torque / ca.DM(T))
    share = ca.vertcat(*shares)
    one = np.ones(share.numel())
    constraints = [
        Constraint(f"torques{name}, over their limits", share, -one, one, "1"),
        equality(f"balance of wrenches{name}", balance / max(capacity.sizes[1]), "1"),
    ]
    if moving:
        constraints.append(equality(f"acceleration of contacts{name}", ca.vertcat(*moved), "1"))
    if len(bounds.matrix):
        held = [strong * h for strong, h in zip(capacity.sizes[1], wrenches, strict=True)]
        constraints.append(kept_bounds(f"contact wrenches{name}", bounds, ca.vertcat(*held)))
    return moving + wrenches, constraints


def kept_bounds(name: str, bounds: WrenchBounds, wrenches: ca.SX) -> Constraint:
    """Contact wrenches, stacked, within their bounds."""
    most = np.ones(len(bounds.matrix))
    return Constraint(name, ca.DM(bounds.matrix) @ wrenches, -np.inf * most, most, "1")
