"""The posture program: maximise an objective over all joint positions under hard constraints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from copose.capability import symmetric
from copose.cell.cell import Cell
from copose.cell.dynamics import CellDynamics
from copose.cell.variables import Places
from copose.constraints.clearance import Apart
from copose.constraints.constraint import Constraint, closure_constraints, equality
from copose.constraints.torque import holding_addition, limits_addition
from copose.objectives.ellipsoid_measures import EllipsoidMeasure, Objective
from copose.objectives.limits_measures import LimitsMeasure
from copose.poses import Array
from copose.posture.solvers.hessian import differenced_hessian
from copose.posture.solvers.ipopt import Ipopt

IPOPT: dict[str, Any] = {
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.tol": 1e-9,
    "ipopt.constr_viol_tol": 1e-10,
    # Bounds are joint limits: not a rounding error beyond them.
    "ipopt.bound_relax_factor": 0.0,
    # A point that is only acceptable is a failure.
    "ipopt.acceptable_iter": 0,
    "ipopt.max_iter": 200,
    "print_time": False,
    # Programs with more equations than unknowns are no news, and no reason to warn.
    "inputs_check": False,
    "calc_lam_p": False,
    "show_eval_warnings": False,
    "error_on_fail": False,
}


# How wide the bounds of an objective with kinks start, after its smooth stand-in was solved; and
# what is tried after a failure.
_FIRST_SLACK, _WIDER_SLACKS = 0.02, (0.2, 0.05)
# How far beside its start, rad or m, a solve without kinks is tried again.
_NUDGE = 0.03


@dataclass(frozen=True, eq=False)
class LocalSolve:
    """How one run of IPOPT ended.

    Attributes:
        q: joint positions of all arms, stacked, (N,); where more is free, that after the joints.
        converged: whether IPOPT met its tolerance.
        status: in IPOPT's words.
        violations: the largest violation of each constraint, by name.
        optimality: the scaled error of the optimality conditions, infinite where none is known.
    """

    q: Array
    converged: bool
    status: str
    violations: dict[str, float]
    optimality: float = np.inf


@dataclass(frozen=True, eq=False)
class _Task:
    """maximise value(q, beside; parameters, numbers) subject to constraints."""

    q: ca.SX
    beside: ca.SX
    parameters: ca.SX
    numbers: ca.SX
    value: ca.SX
    constraints: tuple[Constraint, ...]

    @property
    def stacked(self) -> ca.SX:
        """Expressions of all constraints."""
        return ca.vertcat(*(c.expression for c in self.constraints))


@dataclass(frozen=True, eq=False)
class Given:
    """What a task is solved for.

    Attributes:
        place: `Cell.parameters`, or `Freedom.numbers` where more than joints is free.
        numbers: of the objective, and what else the program takes.
        beside: where the variables that torque limits add start.
        weight: of a case.
    """

    place: Array
    numbers: Array
    beside: Array = field(default_factory=lambda: np.zeros(0))
    weight: float = 1.0


class _Solver:
    """IPOPT on: minimise −value subject to constraints and bounds on the joints."""

    def __init__(
        self,
        task: _Task,
        places: Places | None = None,
        *,
        exact_hessian: bool = False,
        quick: bool = False,
    ) -> None:
        """Build the solver of a task, or of one for each of the cases of ``places``.

        Where many solves follow each other from near their ends quasi-Newton steps come first: they
        take a sixth of the time, and more only where they fail.
        """
        if places is None:
            moving, beside, given = task.q, task.beside, ca.vertcat(task.parameters, task.numbers)
            value, g = task.value, task.stacked
            suffixes = [""]
        else:
            moving, beside, given, value, g = _laid_out(task, places)
            suffixes = places.suffixes
        constraints = [(c, c.name + suffix) for suffix in suffixes for c in task.constraints]
        edges = np.cumsum([0] + [c.expression.numel() for c, _ in constraints])
        self.rows = {
            name: slice(int(start), int(stop))
            for (_, name), start, stop in zip(constraints, edges[:-1], edges[1:], strict=True)
        }
        self.expressions: dict[str, ca.SX] = {
            "x": ca.vertcat(moving, beside), "p": given, "f": -value, "g": g,
        }  # fmt: skip
        self._lower = np.concatenate([c.lower for c, _ in constraints])
        self._upper = np.concatenate([c.upper for c, _ in constraints])
        self._free = np.full(beside.numel(), np.inf)
        self._exact_hessian, self._differenced = exact_hessian, moving.numel()
        self._quick: Ipopt | None = None
        if quick and not exact_hessian:
            self._quick = self._built({"ipopt.hessian_approximation": "limited-memory"})
        else:
            assert self._solver is not None

    @cached_property
    def _solver(self) -> Ipopt:
        if self._exact_hessian:
            # Starts keep torque limits already.
            return self._built({"ipopt.mu_init": 1e-2})
        hessian = differenced_hessian(self.expressions, self._differenced)
        return self._built({"hess_lag": hessian})

    def _built(self, options: dict[str, Any]) -> Ipopt:
        x, p, g = (self.expressions[key].numel() for key in "xpg")
        return Ipopt("posture", self.expressions, (x, p, g), IPOPT | options)

    def run(
        self, start: Array, extra: Array, parameters: Array, lower: Array, upper: Array
    ) -> LocalSolve:
        if self._quick is not None:
            end = self._run(self._quick, start, extra, parameters, lower, upper)
            if end.converged:
                return end
        return self._run(self._solver, start, extra, parameters, lower, upper)

    def _run(
        self,
        solver: Ipopt,
        start: Array,
        extra: Array,
        parameters: Array,
        lower: Array,
        upper: Array,
    ) -> LocalSolve:
        answer = solver(
            x0=np.concatenate([start, extra]),
            p=parameters,
            lbx=np.concatenate([lower, -self._free]),
            ubx=np.concatenate([upper, self._free]),
            lbg=self._lower,
            ubg=self._upper,
        )
        stats = solver.stats()
        values = np.array(answer["g"]).ravel()
        excess = np.maximum(np.maximum(self._lower - values, values - self._upper), 0.0)
        return LocalSolve(
            q=np.clip(np.array(answer["x"]).ravel()[: len(start)], lower, upper),
            converged=stats["return_status"] == "Solve_Succeeded",
            status=str(stats["return_status"]),
            violations={
                name: float(excess[rows].max(initial=0.0)) for name, rows in self.rows.items()
            },
            optimality=stats["iterations"]["inf_du"][-1] if "iterations" in stats else np.inf,
        )


def _laid_out(task: _Task, places: Places) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX, ca.SX]:
    """Joints with what is free, what else is variable, parameters, value and constraints."""
    count = len(places.cases)
    one = ca.Function(
        "task",
        [task.q, task.beside, task.parameters, task.numbers],
        [task.value, task.stacked],
    )
    joints = [ca.SX.sym(f"q_{k}", task.q.numel()) for k in range(count)]
    beside = [ca.SX.sym(f"beside_{k}", task.beside.numel()) for k in range(count)]
    free = ca.SX.sym("free", places.size)
    given = [ca.SX.sym(f"places_{k}", places.count) for k in range(count)]
    numbers = [ca.SX.sym(f"numbers_{k}", task.numbers.numel()) for k in range(count)]
    weights = ca.SX.sym("weights", count)
    total, g = ca.SX(0), []
    for k in range(count):
        place = places.moved(places.own(free, k), given[k])
        value, rows = one(joints[k], beside[k], place, numbers[k])
        total += weights[k] * value
        g.append(rows)
    parameters = [part for pair in zip(given, numbers, strict=True) for part in pair]
    return (
        ca.vertcat(*joints, free),
        ca.vertcat(*beside),
        ca.vertcat(*parameters, weights),
        total,
        ca.vertcat(*g),
    )


class PostureProgram:
    """minimise −objective(q; object, numbers) subject to closure, joint and torque limits.

    Object pose, mass, inertia and the objective's numbers (directions, weights, demands) are
    parameters and joint limits are bounds: building is done once, in the constructor, and every
    `solve` only solves.

    Attributes:
        objective: what is maximised.
        constraints: what holds at every solution.
        rows: which rows of the stacked constraints each of them is, by name.
        expressions: the program as ``x``, ``p``, ``f`` and ``g``.
    """

    def __init__(
        self,
        cell: Cell,
        objective: Objective,
        numbers: int,
        capacity: CellDynamics | None = None,
        places: Places | None = None,
        kept_apart: Apart | None = None,
    ) -> None:
        """Build the program of a cell.

        Args:
            cell: object and joints may be elsewhere when it is solved.
            objective: what is maximised.
            numbers: how many parameters it has.
            capacity: what torque limits allow, where they matter.
            places: where more than joints is free.
            kept_apart: what may not touch.
        """
        self.objective, self._places = objective, places
        system = cell.system
        symbols = ca.SX.sym("numbers", numbers)
        given, slots = symbols, ca.SX(0, 1)
        constraints = closure_constraints(system, None if places is None else places.pinned)
        if kept_apart is not None:
            slots = ca.SX.sym("witnesses", kept_apart.numbers)
            constraints = (*constraints, *kept_apart.constraints(system, slots))
        beside: list[ca.SX] = []
        if cell.problem.constraints.static_torque:
            assert capacity is not None
            hold = holding_addition(system, capacity)
            beside, constraints = [hold.variables], (*constraints, *hold.constraints)

        def task(extra: ca.SX, value: ca.SX, constraints: tuple[Constraint, ...]) -> _Task:
            variables = ca.vertcat(*beside, extra)
            numbers = ca.vertcat(given, slots)
            return _Task(system.q, variables, system.parameters, numbers, value, constraints)

        self._gram: ca.Function | None = None
        self._smooth = None
        if isinstance(objective, EllipsoidMeasure):
            axes = list(cell.problem.axes)
            gram = objective.form.system_gram(system, objective.scales)[axes, axes]
            formulation = objective.formulate(gram, symbols)
            self._gram = ca.Function("gram", [system.q, system.parameters], [gram])
            if formulation.smooth is not None:
                stand_in = task(ca.SX(0, 1), formulation.smooth, constraints)
                self._smooth = _Solver(
                    stand_in, places, quick=kept_apart is not None and places is None
                )
            if formulation.zero.numel():
                constraints += (equality("bounds on the semi-axes", formulation.zero, "1"),)
            whole = task(formulation.extra, formulation.value, constraints)
        else:
            assert isinstance(objective, LimitsMeasure) and capacity is not None
            turned = None
            if places is not None:
                # Demands are told for the inertia, in world axes, of where a solve starts.
                m = system.space.m
                inertia = ca.SX.sym("inertia", m * (m + 1) // 2)
                given = ca.vertcat(symbols, inertia)
                turned = system.object.M_o - symmetric(inertia, m)
            addition = limits_addition(system, objective, symbols, capacity, turned)
            assert addition.value is not None
            beside = [addition.variables, *beside]
            value = addition.value / addition.size
            whole = task(ca.SX(0, 1), value, (*constraints, *addition.constraints))
        self.constraints = whole.constraints
        self._exact = _Solver(
            whole,
            places,
            exact_hessian=isinstance(objective, LimitsMeasure),
            quick=kept_apart is not None and places is None,
        )
        self.rows, self.expressions = self._exact.rows, self._exact.expressions

    def gram_at(self, q: Array, parameters: Array) -> Array:
        """G of stacked joint positions, (a, a), of an objective that measures an ellipsoid."""
        assert self._gram is not None
        return np.array(self._gram(q, parameters))

    def solve(self, start: Array, given: Sequence[Given], lower: Array, upper: Array) -> LocalSolve:
        """One local solve.

        Where the objective has kinks its smooth stand-in is solved first, and the program itself
        from there; should that fail, once more with wider bounds and from the start itself. What
        is smooth and fails is tried once more from a little beside.

        Args:
            start: joint positions to start from, (N,); where more is free, of all cases and then
                the free coordinates, see `Places`.
            given: what each case is solved for.
            lower: joint limits with margin, −inf where none, (N,), and of what else is free.
            upper: alike.
        """
        numbers = np.concatenate([part for each in given for part in (each.place, each.numbers)])
        if self._places is not None:
            numbers = np.concatenate([numbers, [each.weight for each in given]])
        if self._gram is not None and not all(
            np.all(np.isfinite(gram)) for gram in self._grams(start, given)
        ):
            return _not_started(start)
        more = np.concatenate([each.beside for each in given])
        first = self._exact if self._smooth is None else self._smooth
        near = first.run(start, more, numbers, lower, upper)
        if not near.converged:
            nudge = _NUDGE * np.random.default_rng(0).normal(size=len(start))
            near = first.run(start + nudge, more, numbers, lower, upper)
        if self._smooth is None or not isinstance(self.objective, EllipsoidMeasure):
            return near
        measure = self.objective
        if near.converged and self._at_ceiling(measure, self._grams(near.q, given)):
            return near
        attempts = [(near.q, _FIRST_SLACK), *((start, slack) for slack in _WIDER_SLACKS)]
        end = near
        for q, slack in attempts:
            grams = self._grams(q, given)
            if any(not np.all(np.isfinite(G)) or np.linalg.cond(G) > 1e13 for G in grams):
                end = _not_started(q)
                continue
            extra = [
                part
                for each, gram in zip(given, grams, strict=True)
                for part in (each.beside, measure.extra_start(gram, slack))
            ]
            end = self._exact.run(q, np.concatenate(extra), numbers, lower, upper)
            if end.converged:
                break
        return end

    def _grams(self, start: Array, given: Sequence[Given]) -> list[Array]:
        """G of every case."""
        if self._places is None:
            return [self.gram_at(start, given[0].place)]
        return [
            self.gram_at(q, place)
            for q, place in self._places.taken(start, [each.place for each in given])
        ]

    def _at_ceiling(self, objective: EllipsoidMeasure, grams: Sequence[Array]) -> bool:
        return all(objective.of_grams(gram[None])[0] >= objective.ceiling - 1e-9 for gram in grams)


def _not_started(q: Array) -> LocalSolve:
    return LocalSolve(q, False, "Singular_Start", {})
