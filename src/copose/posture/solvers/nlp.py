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
from copose.constraints.constraint import Constraint, ConstraintTerm, closure_constraints
from copose.objectives.objective import Objective, Term
from copose.poses import Array
from copose.posture.optimum import LocalSolve
from copose.posture.solvers.hessian import differenced_hessian
from copose.posture.solvers.ipopt import Ipopt


def ipopt_options(**changes: Any) -> dict[str, Any]:
    """Options of IPOPT for posture programs, with changes, in CasADi's words without ``ipopt.``."""
    options: dict[str, Any] = {
        "print_level": 0,
        "sb": "yes",
        "tol": 1e-9,
        "constr_viol_tol": 1e-10,
        # Bounds are joint limits: not a rounding error beyond them.
        "bound_relax_factor": 0.0,
        # A point that is only acceptable is a failure.
        "acceptable_iter": 0,
        "max_iter": 200,
    }
    return {f"ipopt.{name}": value for name, value in (options | changes).items()} | {
        "print_time": False,
        # Programs with more equations than unknowns are no news, and no reason to warn.
        "inputs_check": False,
        "calc_lam_p": False,
        "show_eval_warnings": False,
        "error_on_fail": False,
    }


@dataclass(frozen=True)
class SharpeningOptions:
    """Attempts at a program without kinks and at the one with kinks from there."""

    first_slack: float = 0.02  # of the logarithm of an eigenvalue, how far its bound starts off
    wider_slacks: tuple[float, ...] = (0.2, 0.05)  # tried after a failure
    nudge: float = 0.03  # rad or m beside its start, where a smooth program is tried again


@dataclass(frozen=True, eq=False)
class _Task:
    """The program to maximise value(q, added; parameters, numbers) subject to constraints."""

    q: ca.SX
    added: ca.SX
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
    """Numbers that a program is solved for.

    Attributes:
        place: `Cell.parameters`, or `Freedom.numbers` where more than joints is free.
        numbers: of the objective, and what else the program takes.
        added: where the variables that torque limits add start.
        weight: of a case.
    """

    place: Array
    numbers: Array
    added: Array = field(default_factory=lambda: np.zeros(0))
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
            moving, added, given = task.q, task.added, ca.vertcat(task.parameters, task.numbers)
            value, g = task.value, task.stacked
            suffixes = [""]
        else:
            moving, added, given, value, g = _laid_out(task, places)
            suffixes = places.suffixes
        constraints = [(c, c.name + suffix) for suffix in suffixes for c in task.constraints]
        edges = np.cumsum([0] + [c.expression.numel() for c, _ in constraints])
        self.rows = {
            name: slice(int(start), int(stop))
            for (_, name), start, stop in zip(constraints, edges[:-1], edges[1:], strict=True)
        }
        self.expressions: dict[str, ca.SX] = {
            "x": ca.vertcat(moving, added), "p": given, "f": -value, "g": g,
        }  # fmt: skip
        self._lower = np.concatenate([c.lower for c, _ in constraints])
        self._upper = np.concatenate([c.upper for c, _ in constraints])
        self._free = np.full(added.numel(), np.inf)
        self._exact_hessian, self._differenced = exact_hessian, moving.numel()
        self._quick: Ipopt | None = None
        if quick and not exact_hessian:
            self._quick = self._built(ipopt_options(hessian_approximation="limited-memory"))
        else:
            assert self._solver is not None

    @cached_property
    def _solver(self) -> Ipopt:
        if self._exact_hessian:
            # Starts keep torque limits already.
            return self._built(ipopt_options(mu_init=1e-2))
        hessian = differenced_hessian(self.expressions, self._differenced)
        return self._built(ipopt_options() | {"hess_lag": hessian})

    def _built(self, options: dict[str, Any]) -> Ipopt:
        x, p, g = (self.expressions[key].numel() for key in "xpg")
        return Ipopt("posture", self.expressions, (x, p, g), options)

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
        [task.q, task.added, task.parameters, task.numbers],
        [task.value, task.stacked],
    )
    joints = [ca.SX.sym(f"q_{k}", task.q.numel()) for k in range(count)]
    added = [ca.SX.sym(f"added_{k}", task.added.numel()) for k in range(count)]
    free = ca.SX.sym("free", places.size)
    given = [ca.SX.sym(f"places_{k}", places.count) for k in range(count)]
    numbers = [ca.SX.sym(f"numbers_{k}", task.numbers.numel()) for k in range(count)]
    weights = ca.SX.sym("weights", count)
    total, g = ca.SX(0), []
    for k in range(count):
        place = places.moved(places.own(free, k), given[k])
        value, rows = one(joints[k], added[k], place, numbers[k])
        total += weights[k] * value
        g.append(rows)
    parameters = [part for pair in zip(given, numbers, strict=True) for part in pair]
    return (
        ca.vertcat(*joints, free),
        ca.vertcat(*added),
        ca.vertcat(*parameters, weights),
        total,
        ca.vertcat(*g),
    )


class PostureProgram:
    """The program to minimise −objective(q; object, numbers) subject to closure and limits.

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
        size: int,
        capacity: CellDynamics | None = None,
        terms: Sequence[ConstraintTerm] = (),
        places: Places | None = None,
        options: SharpeningOptions = SharpeningOptions(),
    ) -> None:
        """Build the program of a cell.

        Args:
            cell: object and joints may be elsewhere when it is solved.
            objective: what is maximised.
            size: how many parameters it has.
            capacity: equations of motion, where torque limits matter.
            terms: of the constraints.
            places: where more than joints is free.
            options: how often it is tried.
        """
        self.objective, self._places, self._options = objective, places, options
        system = cell.system
        numbers = ca.SX.sym("numbers", size)
        parameters, inertia = [numbers], None
        if places is not None:
            # Demands are told for the inertia, in world axes, of where a solve starts.
            m = system.space.m
            entries = ca.SX.sym("inertia", m * (m + 1) // 2)
            inertia = symmetric(entries, m)
            parameters.append(entries)
        parameters += [term.parameters for term in terms]
        pinned = None if places is None else places.pinned
        kept = [*closure_constraints(system, pinned), *(c for t in terms for c in t.constraints)]
        own = objective.term(system, cell.problem.axes, numbers, capacity, inertia)
        variables = [own.variables, *(term.variables for term in terms)]
        self._gram = None
        if own.gram is not None:
            self._gram = ca.Function("gram", [system.q, system.parameters], [own.gram])

        def solver(part: Term, variables: list[ca.SX], constraints: list[Constraint]) -> _Solver:
            task = _Task(
                system.q, ca.vertcat(*variables), system.parameters, ca.vertcat(*parameters),
                part.value, tuple(constraints),
            )  # fmt: skip
            quick = places is None and any(term.parameters.numel() for term in terms)
            return _Solver(task, places, exact_hessian=part.exact_hessian, quick=quick)

        kept += own.constraints
        self._first, self._sharp = solver(own, variables, kept), None
        if own.sharp is not None:
            kept, variables = [*kept, *own.sharp.constraints], [*variables, own.sharp.variables]
            self._sharp = solver(own.sharp, variables, kept)
        self.constraints, last = tuple(kept), self._sharp or self._first
        self.rows, self.expressions = last.rows, last.expressions

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
        numbers = np.concatenate([part for case in given for part in (case.place, case.numbers)])
        if self._places is not None:
            numbers = np.concatenate([numbers, [case.weight for case in given]])
        if self._gram is not None and not all(
            np.all(np.isfinite(gram)) for gram in self._grams(start, given)
        ):
            return _not_started(start)
        options, added = self._options, np.concatenate([case.added for case in given])
        near = self._first.run(start, added, numbers, lower, upper)
        if not near.converged:
            nudge = options.nudge * np.random.default_rng(0).normal(size=len(start))
            near = self._first.run(start + nudge, added, numbers, lower, upper)
        if self._sharp is None:
            return near
        if near.converged and all(map(self.objective.at_ceiling, self._grams(near.q, given))):
            return near
        attempts = [(near.q, options.first_slack)]
        attempts += [(start, slack) for slack in options.wider_slacks]
        end = near
        for q, slack in attempts:
            grams = self._grams(q, given)
            if any(not np.all(np.isfinite(G)) or np.linalg.cond(G) > 1e13 for G in grams):
                end = _not_started(q)
                continue
            extra = [
                part
                for case, gram in zip(given, grams, strict=True)
                for part in (case.added, self.objective.sharp_start(gram, slack))
            ]
            end = self._sharp.run(q, np.concatenate(extra), numbers, lower, upper)
            if end.converged:
                break
        return end

    def _grams(self, start: Array, given: Sequence[Given]) -> list[Array]:
        """G of every case."""
        if self._places is None:
            return [self.gram_at(start, given[0].place)]
        return [
            self.gram_at(q, place)
            for q, place in self._places.taken(start, [case.place for case in given])
        ]


def _not_started(q: Array) -> LocalSolve:
    return LocalSolve(q, False, "Singular_Start", {})
