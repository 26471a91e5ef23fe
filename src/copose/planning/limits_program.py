"""What torque limits add to the posture program: variables, equations and bounds.

Joint accelerations and contact wrenches are variables of their own, so that torques are simple
expressions and nothing is inverted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from copose.capability.contact_limits import WrenchBounds
from copose.mechanics import System
from copose.planning.constraints import Constraint, equality
from copose.planning.limits_measures import LimitsMeasure
from copose.poses import Array


@dataclass(frozen=True, eq=False)
class Addition:
    """Variables and constraints that join a program.

    Attributes:
        variables: stacked.
        constraints: on them and on the joints.
        value: what they make of an objective, None where they are a constraint alone.
    """

    variables: ca.SX
    constraints: tuple[Constraint, ...]
    value: ca.SX | None = None


def limits_addition(
    system: System,
    objective: LimitsMeasure,
    numbers: ca.SX,
    bounds: WrenchBounds,
    turned: ca.SX | None = None,
) -> Addition:
    """The least t of an objective's demands.

    Variables are those of each demand, t first, see `_demand`; with several demands the last
    variable is the least t.

    Args:
        system: the expressions.
        objective: whose demands they are.
        numbers: the demands, as `LimitsMeasure.parted` takes them.
        bounds: on contact wrenches.
        turned: by how much M_o differs from that for which the demands are told, (m, m).
    """
    bounds = bounds if objective.balanced else bounds.none
    reached, variables, constraints = [], [], []
    for k, (motion, load) in enumerate(objective.parted(numbers)):
        name = "" if objective.programmed == 1 else f" of demand {k + 1}"
        t = ca.SX.sym("t")
        moved = None if objective.still else motion
        if turned is not None:
            more_load = turned @ objective.carried(motion, system.object.mass)
            load += ca.vertcat(more_load, ca.SX(load.shape[0] - more_load.shape[0], 2))
        own, more = _demand(system, moved, load, t, objective.scales, bounds, name)
        reached.append(t)
        variables += [t, *own]
        constraints += more
    if objective.programmed == 1:
        return Addition(ca.vertcat(*variables), tuple(constraints), reached[0])
    least = ca.SX.sym("least")
    ahead = ca.vertcat(*(t - least for t in reached))
    above = Constraint(
        "least of the demands", ahead, np.zeros(len(reached)), np.full(len(reached), np.inf), "1"
    )
    return Addition(ca.vertcat(*variables, least), (*constraints, above), least)


def holding_addition(system: System, limits: Sequence[Array], bounds: WrenchBounds) -> Addition:
    """Some contact wrenches hold the object at rest; they are the variables, stacked."""
    b, fall = len(system.space.balance), system.gravity
    rows = 2 if system.space.planar else 3
    weight = -system.object.mass * ca.DM(fall[:rows])
    load = ca.horzcat(ca.vertcat(weight, ca.SX(b - rows, 1)), ca.SX(b, 1))
    still = _demand(system, None, load, ca.SX(0), limits, bounds, " that hold the object")
    return Addition(ca.vertcat(*still[0]), tuple(still[1]))


def _demand(
    system: System,
    motion: ca.SX | None,
    load: ca.SX,
    t: ca.SX,
    limits: Sequence[Array],
    bounds: WrenchBounds,
    name: str,
) -> tuple[list[ca.SX], list[Constraint]]:
    """Joint accelerations of all arms (none where ``motion`` is None), then contact wrenches."""
    given = ca.vertcat(1, t)
    rows = list(range(load.shape[0]))
    speeding, wrenches, moved, shares, balance = [], [], [], [], -(load @ given)
    for i, (arm, T) in enumerate(zip(system.arms, limits, strict=True)):
        coupling = system.coupling(i)
        h = ca.SX.sym(f"h_{arm.arm.name}", system.space.m)
        if motion is None:
            torque, _ = arm.driven(ca.SX(arm.arm.n, 1), coupling.fall, h)
        else:
            faster = ca.SX.sym(f"qdd_{arm.arm.name}", arm.arm.n)
            torque, reached = arm.driven(faster, coupling.fall, h)
            moved.append(reached - coupling.motion @ (motion @ given))
            speeding.append(faster)
        balance += coupling.balance[rows, :] @ h
        wrenches.append(h)
        shares.append(torque / ca.DM(T))
    share = ca.vertcat(*shares)
    one = np.ones(share.numel())
    constraints = [
        Constraint(f"torques{name}, over their limits", share, -one, one, "1"),
        equality(f"balance of wrenches{name}", balance, "N, N·m"),
    ]
    if moved:
        constraints.append(equality(f"acceleration of contacts{name}", ca.vertcat(*moved), "m/s²"))
    if len(bounds.bound):
        held = ca.DM(bounds.matrix) @ ca.vertcat(*wrenches)
        open_ = np.full(len(bounds.bound), -np.inf)
        constraints.append(Constraint(f"contact wrenches{name}", held, open_, bounds.bound, "N"))
    return speeding + wrenches, constraints
