"""Limits of joint accelerations and torques at a knot of a motion, as constraints."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from copose.cell.cell import Cell
from copose.cell.dynamics import CellDynamics
from copose.constraints.constraint import Constraint, equality
from copose.constraints.torque import kept_bounds
from copose.motion.dynamics.inverse_dynamics import exertable
from copose.poses import Array


def driving_constraints(
    cell: Cell, rates: ca.SX, accelerations: ca.SX, inertial: ca.SX, capacity: CellDynamics | None
) -> tuple[ca.SX, list[Constraint]]:
    """Accelerations within their limits; with ``dynamic_torque`` torques too, by some wrenches.

    Args:
        cell: whose arms they are.
        rates: joint speeds, (N,).
        accelerations: of the joints, (N,).
        inertial: force and moment that the object's motion takes, (b,).
        capacity: what torque limits allow, with ``dynamic_torque``.

    Returns:
        The contacts' wrenches as variables, over `CellDynamics.strength`, and the constraints.
    """
    constraints = []
    limits = np.concatenate([[joint.acceleration for joint in arm.joints] for arm in cell.arms])
    limited = np.flatnonzero(np.isfinite(limits)).tolist()
    if limited:
        share = accelerations[limited] / ca.DM(limits[limited])
        constraints.append(_within_limits("accelerations", share))
    if not cell.dynamic_torque:
        return ca.SX(0, 1), constraints
    assert capacity is not None
    wrenches, balance = _torques(cell, rates, accelerations, inertial, capacity)
    return wrenches, constraints + balance


def _torques(
    cell: Cell, rates: ca.SX, accelerations: ca.SX, inertial: ca.SX, capacity: CellDynamics
) -> tuple[ca.SX, list[Constraint]]:
    """Contact wrenches that carry the object, with torques within their limits."""
    system = cell.system
    edges = np.cumsum([0] + [arm.n for arm in cell.arms]).tolist()
    rows = 2 if system.space.planar else 3
    weight = -system.object.mass * ca.DM(system.gravity[:rows])
    balance = -inertial
    balance[list(range(rows))] -= weight
    wrenches, shares, strong = [], [], capacity.strength
    parts = zip(ca.vertsplit(rates, edges), ca.vertsplit(accelerations, edges), strict=True)
    for i, (rate, acceleration) in enumerate(parts):
        arm, coupling = system.arms[i], system.coupling(i)
        h = ca.SX.sym(f"h_{arm.arm.name}", system.space.m)
        torque, _ = arm.driven(acceleration, coupling.fall, strong * h, rate)
        balance += coupling.balance @ (strong * h)
        wrenches.append(h)
        shares.append(torque / ca.DM(capacity.limits[i]))
    constraints = [
        _within_limits("torques", ca.vertcat(*shares)),
        equality("balance of wrenches", balance / strong, "1"),
    ]
    if len(capacity.bounds.matrix):
        forces = strong * ca.vertcat(*wrenches)
        constraints.append(kept_bounds("contact wrenches", capacity.bounds, forces))
    return ca.vertcat(*wrenches), constraints


def _within_limits(what: str, share: ca.SX) -> Constraint:
    """The constraint that limits are kept, on the shares of them that are used."""
    one = np.ones(share.numel())
    return Constraint(f"{what}, over their limits", share, -one, one, "1")


def spared(constraint: Constraint, share: ca.SX) -> Constraint:
    """A constraint with limits of torques and accelerations multiplied by a variable."""
    if not constraint.name.endswith(", over their limits"):
        return constraint
    size = constraint.expression.numel()
    nothing, unbounded = np.zeros(size), np.full(size, np.inf)
    return Constraint(
        constraint.name,
        ca.vertcat(constraint.expression - share, constraint.expression + share),
        np.concatenate([-unbounded, nothing]),
        np.concatenate([nothing, unbounded]),
        "1",
    )


def independent(cell: Cell, constraint: Constraint) -> Constraint:
    """A constraint whose rows are independent: a balance of wrenches without those that follow.

    What contacts cannot do anything about must balance by itself: `Torques.least` sees to that.
    """
    rows = exertable(cell)
    whole = constraint.expression.numel() == rows.shape[1] > len(rows)
    if not whole or not constraint.name.startswith("balance of wrenches"):
        return constraint
    own = cell.system.object.rotation.T
    balance = list(cell.system.space.balance)
    turned = ca.diagcat(own, own)[balance, balance] @ constraint.expression
    return equality(constraint.name, ca.DM(rows) @ turned, constraint.unit)


def tightened(
    constraints: Sequence[Constraint], torques: Array, accelerations: Array
) -> Array | None:
    """Factors of all constraints' bounds at every knot, (n, g); None where nothing is tightened.

    Args:
        constraints: at a knot, g rows in all.
        torques: factors of their limits by knot, (n,).
        accelerations: alike.
    """
    if np.all(torques == 1.0) and np.all(accelerations == 1.0):
        return None
    by_name = {
        "torques, over their limits": torques, "accelerations, over their limits": accelerations,
    }  # fmt: skip
    none = np.ones(len(torques))
    return np.hstack([
        np.tile(by_name.get(constraint.name, none)[:, None], constraint.expression.numel())
        for constraint in constraints
    ])  # fmt: skip
