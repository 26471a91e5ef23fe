"""Constraints of a program as data: bounds on expressions, the closed chain among them."""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from copose.mechanics import System
from copose.poses import Array


@dataclass(frozen=True, eq=False)
class Constraint:
    """lower ≤ expression ≤ upper, with a name to report it by."""

    name: str
    expression: ca.SX
    lower: Array
    upper: Array
    unit: str


@dataclass(frozen=True, eq=False)
class ConstraintTerm:
    """The term of a constraint on postures in a program.

    Attributes:
        variables: beside the joints, stacked.
        constraints: on them and on the joints.
        parameters: of these, stacked.
    """

    variables: ca.SX
    constraints: tuple[Constraint, ...]
    parameters: ca.SX = field(default_factory=lambda: ca.SX(0, 1))


def equality(name: str, expression: ca.SX, unit: str) -> Constraint:
    """The constraint that an expression vanishes."""
    zero = np.zeros(expression.numel())
    return Constraint(name, expression, zero, zero, unit)


def closure_constraints(system: System, pinned: Array | None = None) -> tuple[Constraint, ...]:
    """Every tip at its grasp: the residuals of `System.closure` are zero.

    Args:
        system: the expressions.
        pinned: combinations of the fixed arms' residuals, (rank, rows), that what is free beside
            the joints can change; None where nothing is, and fixed arms are no matter of it.
    """
    unit = "m, rad" if system.space.rigid else "m"
    moving = tuple(
        equality(f"closure of arm {arm.arm.name}", system.closure(i), unit)
        for i, arm in enumerate(system.arms)
        if not arm.arm.fixed
    )
    if pinned is None or not len(pinned):
        return moving
    held = [system.closure(i) for i, arm in enumerate(system.arms) if arm.arm.fixed]
    return (*moving, equality("closure of fixed arms", ca.DM(pinned) @ ca.vertcat(*held), unit))
