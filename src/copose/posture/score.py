"""The score by which postures are compared: a function of the sums of the arms' terms."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from copose.capability import symmetric, upper_triangle
from copose.cell.cell import Cell
from copose.constraints.posture_constraint import PostureConstraint
from copose.kernels import Kernel
from copose.objectives.objective import Objective

# The score of what a constraint certainly rules out, which no objective is worth.
RULED_OUT = -1e300


class Score:
    """The objective, or what stands in for it, as a function of the sums of the arms' terms.

    Attributes:
        value: kernel of the sums, (s,), and of what is given: postures are compared by it. The
            sums of constraints that have some follow the objective's, and what they certainly rule
            out is worth −10³⁰⁰.
        slope: kernel of the objective's sums alone and of what is given: the value and its
            derivatives by them, (1 + s,).
        gram: kernel of the upper triangle of G, where the objective measures an ellipsoid.
    """

    def __init__(
        self,
        cell: Cell,
        objective: Objective,
        numbers: int,
        constraints: Sequence[PostureConstraint],
    ) -> None:
        """Write down the score of a cell for an objective with so many parameters."""
        space, axes = cell.system.space, cell.problem.axes
        sums = ca.SX.sym("sums", objective.sums.size(space))
        inertia, symbols = ca.SX.sym("M_o", space.m * (space.m + 1) // 2), ca.SX.sym("n", numbers)
        weight = ca.SX.sym("weight", len(space.balance))
        M_o = symmetric(inertia, space.m)
        value = objective.score(sums, M_o, symbols, axes)
        given = ca.vertcat(inertia, weight, symbols)
        self.slope = Kernel(sums, given, ca.vertcat(value, ca.gradient(value, sums)))
        gram = objective.gram(sums, M_o, axes)
        self.gram = None if gram is None else Kernel(sums, given, upper_triangle(gram))
        for constraint in constraints:
            if constraint.sums is not None:
                held = ca.SX.sym("held", constraint.sums.size(space))
                n_joints = sum(arm.n for arm in cell.arms)
                broken = constraint.certainly_broken(held, weight, n_joints)
                value = ca.if_else(broken, RULED_OUT, value)
                sums = ca.vertcat(sums, held)
        self.value = Kernel(sums, given, value)

    @property
    def all(self) -> tuple[Kernel, ...]:
        """All kernels of the score."""
        return (
            (self.value, self.slope) if self.gram is None else (self.value, self.slope, self.gram)
        )
