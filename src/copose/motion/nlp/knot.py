"""The program of a motion at one of its knots, as expressions and compiled kernels."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from functools import cached_property

import casadi as ca
import numpy as np

from copose.cell.cell import Cell
from copose.cell.dynamics import CellDynamics
from copose.constraints.constraint import Constraint, closure_constraints
from copose.constraints.posture_constraint import PostureConstraint
from copose.kernels import Kernel
from copose.motion.nlp.knot_constraints import driving_constraints, independent, spared
from copose.objectives.objective import Objective
from copose.poses import Array, Indices


class MotionKind(Enum):
    """Kinds of programs of a motion: by what is optimised, within which limits."""

    BEST = "best"
    """The objective as it is."""
    SMOOTHED = "smoothed"
    """An objective with kinks is replaced by one without, whose best is near."""
    SHORTEST = "shortest"
    """The duration is minimised, and the objective does not count."""
    SPARING = "sparing"
    """The largest share of torque and acceleration limits is minimised, and nothing else."""
    UNLIMITED = "unlimited"
    """As smoothed, without limits of torques and accelerations."""


class KnotNlp:
    """Variables y, parameters p, value and constraints of a knot; nothing of other knots.

    y are the joints q, (N,), and then: what the objective and held objects add; with rates dq/dφ
    and d²q/dφ², (N,) each, φ the share of the duration, and with torque limits the contacts'
    wrenches, over `CellDynamics.strength`; the level that the least objective must reach; the
    stretch of the duration; the share of torque and acceleration limits.

    Attributes:
        kind: what is optimised.
        shared: the variable, the same at all knots, that is minimised, −level maximised; None where
            the mean of the objective counts.
        slices: of y, by name.
        constraints: on it.
        holding: names of those on holding the object at rest, which some knots may be free of.
        value: kernel of (y, p): the objective, then the constraints.
        slopes: its gradient, then the constraints' Jacobian, entries as ``pattern`` has them.
        pattern: rows and columns of the Jacobian.
        lagrangian: kernel of (y, σ, λ) and p: ∇_y of σ·value + λᵀ constraints.
        rest: of the same: entries of its Jacobian by all of y but q, as ``curved`` has them.
        curved: rows and columns of them, upper triangle.
    """

    def __init__(
        self,
        cell: Cell,
        objective: Objective,
        numbers: int,
        capacity: CellDynamics | None,
        required: Sequence[PostureConstraint],
        kind: MotionKind,
        *,
        worst: bool,
        rates: bool,
    ) -> None:
        """Write the expressions of one program.

        Args:
            cell: whose arms they are.
            objective: what is maximised.
            numbers: how many parameters it has.
            capacity: what torque limits allow, where they matter.
            required: constraints on postures.
            kind: what is optimised.
            worst: whether the least objective of all knots counts, not their mean.
            rates: whether joint speeds and accelerations enter, but where nothing limits them.
        """
        system = cell.system
        symbols = ca.SX.sym("numbers", numbers)
        inertial, duration = ca.SX.sym("inertial", len(system.space.balance)), ca.SX.sym("duration")
        self.kind, self.shared = kind, _shared(kind, worst=worst)
        self.holding: frozenset[str] = frozenset()
        self._counts = [arm.n for arm in cell.arms]
        parts: dict[str, ca.SX] = {"q": system.q}
        constraints, value = list(closure_constraints(system)), ca.SX(0)
        if self.shared in (None, "level"):
            term = objective.term(system, cell.problem.axes, symbols, capacity)
            if term.sharp is not None and kind not in (MotionKind.SMOOTHED, MotionKind.UNLIMITED):
                term = term.sharp
            value = term.natural
            parts["beside"] = term.variables
            constraints += term.constraints
        for constraint in () if kind is MotionKind.UNLIMITED else required:
            added = constraint.term(system, capacity)
            if added is not None:
                parts[constraint.name] = added.variables
                constraints += added.constraints
                if constraint.torque_limited:
                    self.holding |= {row.name for row in added.constraints}
        stretch = ca.SX.sym("stretch") if kind is MotionKind.SHORTEST else ca.SX(1)
        if rates and kind is not MotionKind.UNLIMITED:
            variables, driving = _driven(cell, duration * stretch, inertial, capacity)
            parts |= variables
            constraints += driving
        if self.shared is not None:
            shared = stretch if self.shared == "stretch" else ca.SX.sym(self.shared)
            parts[self.shared] = shared
            constraints = _on_shared(self.shared, shared, value, constraints)
            value = ca.SX(0)
        self.constraints = tuple(independent(cell, constraint) for constraint in constraints)
        edges = np.cumsum([0] + [part.numel() for part in parts.values()])
        self.slices = {
            name: slice(int(a), int(z))
            for name, a, z in zip(parts, edges[:-1], edges[1:], strict=True)
        }
        self.joints, self._y = system.q.numel(), ca.vertcat(*parts.values())
        self._derive(value, ca.vertcat(system.parameters, symbols, inertial, duration))

    def _derive(self, value: ca.SX, p: ca.SX) -> None:
        """Build the kernels of value, constraints and their derivatives."""
        y, g = self._y, ca.vertcat(*(c.expression for c in self.constraints))
        J = ca.jacobian(g, y)
        self.value = Kernel(y, p, ca.vertcat(value, g))
        gradient = ca.densify(ca.gradient(value, y))
        entries = ca.vec(J)[ca.vec(J).sparsity().row()] if J.nnz() else ca.SX(0, 1)
        self.slopes = Kernel(y, p, ca.vertcat(gradient, entries))
        self.pattern: tuple[Indices, Indices] = _pattern(J.sparsity())
        sigma, multipliers = ca.SX.sym("sigma"), ca.SX.sym("multipliers", g.numel())
        slope = ca.gradient(sigma * value + ca.dot(multipliers, g), y)
        weighed = ca.vertcat(y, sigma, multipliers)
        self.lagrangian = Kernel(weighed, p, slope)
        curved = ca.jacobian(slope, y[self.joints :])
        rows, columns = _pattern(curved.sparsity())
        upper = (rows >= self.joints) & (rows <= columns + self.joints)
        self.curved = rows[upper], columns[upper] + self.joints
        places = np.array(ca.vec(curved).sparsity().row(), dtype=np.intp)[upper].tolist()
        kept = ca.vec(curved)[places] if places else ca.SX(0, 1)
        self.rest = Kernel(weighed, p, kept)
        self._slope = slope

    @cached_property
    def moved_by(self) -> dict[str, Indices]:
        """Joints of the arm that a closure is about, by its constraint's name."""
        names = [c.name for c in self.constraints if c.name.startswith("closure of arm ")]
        edges = np.cumsum([0, *self._counts])
        return {
            name: np.arange(a, z) for name, a, z in zip(names, edges[:-1], edges[1:], strict=True)
        }

    @property
    def size(self) -> int:
        """Number of variables y."""
        return int(self._y.numel())

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the constraints, stacked."""
        return (
            np.concatenate([c.lower for c in self.constraints]),
            np.concatenate([c.upper for c in self.constraints]),
        )

    @cached_property
    def coupled(self) -> tuple[Indices, Indices]:
        """Rows and columns of the Lagrangian's Hessian in which q takes part, upper triangle."""
        pattern = ca.jacobian_sparsity(self._slope, self._y)
        rows, columns = _pattern(pattern)
        upper = (rows < self.joints) & (rows <= columns)
        return rows[upper], columns[upper]

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """Everything that may be compiled."""
        return self.lagrangian, self.slopes, self.value, self.rest


def _shared(kind: MotionKind, *, worst: bool) -> str | None:
    """The variable that all knots share and that is optimised, if there is one."""
    shared = {MotionKind.SPARING: "share", MotionKind.SHORTEST: "stretch"}
    return shared.get(kind, "level" if worst else None)


def _on_shared(
    name: str, shared: ca.SX, value: ca.SX, constraints: list[Constraint]
) -> list[Constraint]:
    """Constraints with those on the shared variable: a level below the objective's value, or a
    share by which torque and acceleration limits are multiplied.
    """
    unbounded = np.full(1, np.inf)
    if name == "level":
        return [*constraints, Constraint("level", value - shared, np.zeros(1), unbounded, "1")]
    if name == "share":
        least = np.full(1, 0.95)  # Less is not worth sparing.
        limited = [spared(constraint, shared) for constraint in constraints]
        return [*limited, Constraint("share", shared, least, unbounded, "1")]
    return constraints


def _driven(
    cell: Cell, span: ca.SX, inertial: ca.SX, capacity: CellDynamics | None
) -> tuple[dict[str, ca.SX], list[Constraint]]:
    """Variables and constraints of joint rates, dq/dφ and d²q/dφ², over a duration."""
    count = cell.system.q.numel()
    slopes, bends = ca.SX.sym("slopes", count), ca.SX.sym("bends", count)
    wrenches, constraints = driving_constraints(
        cell, slopes / span, bends / span**2, inertial / span**2, capacity
    )
    return {"slopes": slopes, "bends": bends, "wrenches": wrenches}, constraints


def _pattern(sparsity: ca.Sparsity) -> tuple[Indices, Indices]:
    rows, columns = sparsity.get_triplet()
    return np.array(rows, dtype=np.intp), np.array(columns, dtype=np.intp)
