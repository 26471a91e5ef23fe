"""A demand on torques as variables, equations and bounds of a program.

Joint accelerations and contact wrenches are variables of their own, so that torques are simple
expressions and nothing is inverted.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from copose.capability.contact_limits import WrenchBounds
from copose.capability.torque_limits import JointMotion
from copose.cell.dynamics import CellDynamics
from copose.constraints.constraint import Constraint, equality
from copose.mechanics import System


def demand_term(
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
