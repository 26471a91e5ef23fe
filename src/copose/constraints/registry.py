"""Constraints on postures, in the order in which they are asked and join a program."""

from __future__ import annotations

from copose.cell.cell import Cell
from copose.constraints.kept_clearance import KeptClearance
from copose.constraints.posture_constraint import PostureConstraint
from copose.constraints.static_torque import StaticTorque

CONSTRAINTS: tuple[type[PostureConstraint], ...] = (KeptClearance, StaticTorque)


def constraints_of(cell: Cell, *, moving: bool = False) -> tuple[PostureConstraint, ...]:
    """Constraints that a problem asks for, of postures or, ``moving``, of the knots of its path."""
    asked = (constraint.of(cell, moving=moving) for constraint in CONSTRAINTS)
    return tuple(constraint for constraint in asked if constraint is not None)
