"""What a program along a path holds at one of its knots, as expressions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from copose.cell.cell import Cell
from copose.cell.dynamics import CellDynamics
from copose.constraints.constraint import Constraint, closure_constraints, equality
from copose.constraints.posture_constraint import PostureConstraint
from copose.constraints.torque import kept_bounds
from copose.kernels import Kernel
from copose.motion.dynamics.inverse_dynamics import exertable
from copose.objectives.objective import Objective
from copose.poses import Array, Indices

# How names of constraints on shares of limits end, and what share of them is little enough.
OVER, _ROOM = ", over their limits", 0.95
# How names of balances of wrenches begin.
BALANCE = "balance of wrenches"


@dataclass(frozen=True)
class Form:
    """Which program it is.

    Attributes:
        worst: whether the least objective of all knots counts, not their mean.
        shortest: whether the duration is sought, and nothing else.
        rates: whether joint speeds and accelerations enter.
        rounded: whether an objective with kinks is replaced by one without, whose best is near.
        sparing: whether a motion is sought that keeps torque and acceleration limits, or breaks
            them as little as can be, and nothing else.
        loose: whether limits of torques and accelerations are left out.
    """

    worst: bool = False
    shortest: bool = False
    rates: bool = False
    rounded: bool = False
    sparing: bool = False
    loose: bool = False

    @property
    def common(self) -> str | None:
        """The variable, the same at all knots, that is minimised, −level maximised; None where
        the mean of the objective counts.
        """
        if self.sparing:
            return "share"
        return "stretch" if self.shortest else "level" if self.worst else None


class KnotNlp:
    """Variables y, parameters p, value and constraints of a knot; nothing of other knots.

    y are the joints q, (N,), and then: what the objective and held objects add; with rates dq/dφ
    and d²q/dφ², (N,) each, φ the share of the duration, and with torque limits the contacts'
    wrenches, over `CellDynamics.strength`; the level that the least objective must reach; the
    stretch of the duration; the share of torque and acceleration limits.

    Attributes:
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
        form: Form,
    ) -> None:
        """Write it down.

        Args:
            cell: whose arms they are.
            objective: what is maximised.
            numbers: how many parameters it has.
            capacity: what torque limits allow, where they matter.
            required: constraints on postures.
            form: which program.
        """
        system = cell.system
        symbols = ca.SX.sym("numbers", numbers)
        b = len(system.space.balance)
        inertial, duration = ca.SX.sym("inertial", b), ca.SX.sym("duration")
        constraints = list(closure_constraints(system))
        parts: dict[str, ca.SX] = {"q": system.q}
        value = ca.SX(0)
        if form.common in (None, "level"):
            term = objective.term(system, cell.problem.axes, symbols, capacity)
            if term.sharp is not None and not form.rounded:
                term = term.sharp
            value = term.natural
            parts["beside"] = term.variables
            constraints += term.constraints
        self.holding: frozenset[str] = frozenset()
        for constraint in () if form.loose else required:
            added = constraint.term(system, capacity)
            if added is not None:
                parts[constraint.name] = added.variables
                constraints += added.constraints
                if constraint.torque_limited:
                    self.holding |= {row.name for row in added.constraints}
        stretch = ca.SX.sym("stretch") if form.shortest else ca.SX(1)
        if form.rates:
            slopes, bends = (
                ca.SX.sym("slopes", system.q.numel()),
                ca.SX.sym("bends", system.q.numel()),
            )
            parts |= {"slopes": slopes, "bends": bends}
            span = duration * stretch
            wrenches, more = _driven(
                cell, slopes / span, bends / span**2, inertial / span**2, capacity
            )
            parts["wrenches"] = wrenches
            constraints += more
        if form.common == "level":
            level = ca.SX.sym("level")
            parts["level"] = level
            constraints.append(
                Constraint("level", value - level, np.zeros(1), np.full(1, np.inf), "1")
            )
            value = ca.SX(0)
        if form.shortest:
            parts["stretch"] = stretch
        if form.sparing:
            share = ca.SX.sym("share")
            parts["share"] = share
            constraints = [_spared(constraint, share) for constraint in constraints]
            constraints.append(
                Constraint("share", share, np.full(1, _ROOM), np.full(1, np.inf), "1")
            )
        self.constraints = tuple(_balanced(cell, constraint) for constraint in constraints)
        edges = np.cumsum([0] + [part.numel() for part in parts.values()])
        self.slices = {
            name: slice(int(a), int(z))
            for name, a, z in zip(parts, edges[:-1], edges[1:], strict=True)
        }
        self._y = ca.vertcat(*parts.values())
        self._p = ca.vertcat(system.parameters, symbols, inertial, duration)
        self._value, self._g = value, ca.vertcat(*(c.expression for c in self.constraints))
        self.joints = system.q.numel()
        J = ca.jacobian(self._g, self._y)
        self.value = Kernel(self._y, self._p, ca.vertcat(value, self._g))
        gradient = ca.densify(ca.gradient(value, self._y))
        entries = ca.vec(J)[ca.vec(J).sparsity().row()] if J.nnz() else ca.SX(0, 1)
        self.slopes = Kernel(self._y, self._p, ca.vertcat(gradient, entries))
        self.pattern: tuple[Indices, Indices] = _pattern(J.sparsity())
        sigma, multipliers = ca.SX.sym("sigma"), ca.SX.sym("multipliers", self._g.numel())
        slope = ca.gradient(sigma * value + ca.dot(multipliers, self._g), self._y)
        given = ca.vertcat(self._y, sigma, multipliers)
        self.lagrangian = Kernel(given, self._p, slope)
        others = self._y[self.joints :]
        curved = ca.jacobian(slope, others)
        rows, columns = _pattern(curved.sparsity())
        upper = (rows >= self.joints) & (rows <= columns + self.joints)
        self.curved = rows[upper], columns[upper] + self.joints
        places = np.array(ca.vec(curved).sparsity().row(), dtype=np.intp)[upper].tolist()
        kept = ca.vec(curved)[places] if places else ca.SX(0, 1)
        self.rest = Kernel(given, self._p, kept)
        self._slope = slope
        self._counts = [arm.n for arm in cell.arms]

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
        """Of y."""
        return int(self._y.numel())

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Of the constraints, stacked."""
        return (
            np.concatenate([c.lower for c in self.constraints]),
            np.concatenate([c.upper for c in self.constraints]),
        )

    @cached_property
    def coupled(self) -> tuple[Indices, Indices]:
        """Rows and columns of the Lagrangian's Hessian in which q takes part, upper triangle."""
        pattern = ca.jacobian_sparsity(self._slope, self._y)
        rows, columns = _pattern(pattern)
        mine = (rows < self.joints) & (rows <= columns)
        return rows[mine], columns[mine]

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """Everything that may be compiled."""
        return self.lagrangian, self.slopes, self.value, self.rest


def _balanced(cell: Cell, constraint: Constraint) -> Constraint:
    """A balance of wrenches without rows that follow from the others; all else as it is.

    What contacts cannot do anything about must balance by itself: `Torques.least` sees to that.
    """
    rows = exertable(cell)
    full = constraint.expression.numel() == rows.shape[1] > len(rows)
    if not full or not constraint.name.startswith(BALANCE):
        return constraint
    own = cell.system.object.rotation.T
    balance = list(cell.system.space.balance)
    turned = ca.diagcat(own, own)[balance, balance] @ constraint.expression
    return equality(constraint.name, ca.DM(rows) @ turned, constraint.unit)


def _spared(constraint: Constraint, share: ca.SX) -> Constraint:
    """Limits of torques and accelerations that share multiplies; all else as it is."""
    if not constraint.name.endswith(OVER):
        return constraint
    size = constraint.expression.numel()
    nothing, open_ = np.zeros(size), np.full(size, np.inf)
    return Constraint(
        constraint.name,
        ca.vertcat(constraint.expression - share, constraint.expression + share),
        np.concatenate([-open_, nothing]),
        np.concatenate([nothing, open_]),
        "1",
    )


def _driven(
    cell: Cell, rates: ca.SX, accelerations: ca.SX, inertial: ca.SX, capacity: CellDynamics | None
) -> tuple[ca.SX, list[Constraint]]:
    """Accelerations within their limits; with ``dynamic_torque`` torques too, by some wrenches."""
    system = cell.system
    edges = np.cumsum([0] + [arm.n for arm in cell.arms]).tolist()
    constraints = []
    limits = np.concatenate([[joint.acceleration for joint in arm.joints] for arm in cell.arms])
    limited = np.flatnonzero(np.isfinite(limits)).tolist()
    if limited:
        one = np.ones(len(limited))
        share = accelerations[limited] / ca.DM(limits[limited])
        constraints.append(Constraint(f"accelerations{OVER}", share, -one, one, "1"))
    if not cell.dynamic_torque:
        return ca.SX(0, 1), constraints
    assert capacity is not None
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
    share = ca.vertcat(*shares)
    one = np.ones(share.numel())
    constraints += [
        Constraint(f"torques{OVER}", share, -one, one, "1"),
        equality(BALANCE, balance / strong, "1"),
    ]
    if len(capacity.bounds.matrix):
        held = strong * ca.vertcat(*wrenches)
        constraints.append(kept_bounds("contact wrenches", capacity.bounds, held))
    return ca.vertcat(*wrenches), constraints


def _pattern(sparsity: ca.Sparsity) -> tuple[Indices, Indices]:
    rows, columns = sparsity.get_triplet()
    return np.array(rows, dtype=np.intp), np.array(columns, dtype=np.intp)
