"""The posture program: maximise an objective over all joint positions under hard constraints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from copose.capability.contact_limits import WrenchBounds
from copose.planning.cell import Cell
from copose.planning.constraints import Constraint, closure_constraints, equality
from copose.planning.hessian import differenced_hessian
from copose.planning.limits_measures import LimitsMeasure
from copose.planning.limits_program import holding_addition, limits_addition
from copose.planning.objectives import EllipsoidMeasure, Objective
from copose.poses import Array

_IPOPT: dict[str, Any] = {
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
        q: joint positions of all arms, stacked, (N,).
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


class _Solver:
    """IPOPT on: minimise −value subject to constraints and bounds on the joints."""

    def __init__(
        self,
        variables: tuple[ca.SX, ca.SX],
        parameters: ca.SX,
        value: ca.SX,
        constraints: tuple[Constraint, ...],
        *,
        exact_hessian: bool = False,
    ) -> None:
        """Build the solver; ``variables`` are the joints and what is free beside them."""
        edges = np.cumsum([0] + [c.expression.numel() for c in constraints])
        self.rows = {
            c.name: slice(int(start), int(stop))
            for c, start, stop in zip(constraints, edges[:-1], edges[1:], strict=True)
        }
        self.expressions: dict[str, ca.SX] = {
            "x": ca.vertcat(*variables),
            "p": parameters,
            "f": -value,
            "g": ca.vertcat(*(c.expression for c in constraints)),
        }
        self._lower = np.concatenate([c.lower for c in constraints])
        self._upper = np.concatenate([c.upper for c in constraints])
        self._free = np.full(variables[1].numel(), np.inf)
        options = dict(_IPOPT)
        if exact_hessian:
            # Starts keep torque limits already.
            options["ipopt.mu_init"] = 1e-2
        else:
            options["hess_lag"] = differenced_hessian(self.expressions, variables[0].numel())
        self._solver = ca.nlpsol("posture", "ipopt", self.expressions, options)

    def run(
        self, start: Array, extra: Array, parameters: Array, lower: Array, upper: Array
    ) -> LocalSolve:
        answer = self._solver(
            x0=np.concatenate([start, extra]),
            p=parameters,
            lbx=np.concatenate([lower, -self._free]),
            ubx=np.concatenate([upper, self._free]),
            lbg=self._lower,
            ubg=self._upper,
        )
        stats = self._solver.stats()
        values = np.array(answer["g"]).ravel()
        excess = np.maximum(np.maximum(self._lower - values, values - self._upper), 0.0)
        return LocalSolve(
            q=np.clip(np.array(answer["x"]).ravel()[: len(start)], lower, upper),
            converged=stats["return_status"] == "Solve_Succeeded",
            status=str(stats["return_status"]),
            violations={name: float(excess[rows].max()) for name, rows in self.rows.items()},
            optimality=stats["iterations"]["inf_du"][-1] if "iterations" in stats else np.inf,
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
        bounds: WrenchBounds | None = None,
    ) -> None:
        """Build the program of a cell.

        Args:
            cell: object and joints may be elsewhere when it is solved.
            objective: what is maximised.
            numbers: how many parameters it has.
            bounds: on contact wrenches, where torque limits matter.
        """
        self.objective = objective
        system = cell.system
        symbols = ca.SX.sym("numbers", numbers)
        parameters = ca.vertcat(system.object.parameters, symbols)
        constraints = closure_constraints(system)
        beside: list[ca.SX] = []
        if cell.problem.constraints.static_torque:
            assert bounds is not None and cell.torque_limits is not None
            hold = holding_addition(system, cell.torque_limits, bounds)
            beside, constraints = [hold.variables], (*constraints, *hold.constraints)
        self._gram: ca.Function | None = None
        self._smooth = None
        extra = ca.SX(0, 1)
        if isinstance(objective, EllipsoidMeasure):
            axes = list(cell.problem.axes)
            gram = objective.form.system_gram(system, objective.scales)[axes, axes]
            formulation = objective.formulate(gram, symbols)
            self._gram = ca.Function("gram", [system.q, system.object.parameters], [gram])
            if formulation.smooth is not None:
                smoothed = ca.vertcat(*beside)
                self._smooth = _Solver(
                    (system.q, smoothed), parameters, formulation.smooth, constraints
                )
            value, extra = formulation.value, formulation.extra
            if formulation.zero.numel():
                constraints += (equality("bounds on the semi-axes", formulation.zero, "1"),)
        else:
            assert isinstance(objective, LimitsMeasure) and bounds is not None
            addition = limits_addition(system, objective, symbols, bounds)
            assert addition.value is not None
            value, constraints = addition.value, (*constraints, *addition.constraints)
            beside = [addition.variables, *beside]
        self.constraints = constraints
        self._exact = _Solver(
            (system.q, ca.vertcat(*beside, extra)),
            parameters,
            value,
            constraints,
            exact_hessian=isinstance(objective, LimitsMeasure),
        )
        self.rows, self.expressions = self._exact.rows, self._exact.expressions

    def gram_at(self, q: Array, parameters: Array) -> Array:
        """G of stacked joint positions, (a, a), of an objective that measures an ellipsoid."""
        assert self._gram is not None
        return np.array(self._gram(q, parameters))

    def solve(
        self,
        start: Array,
        parameters: Array,
        numbers: Array,
        lower: Array,
        upper: Array,
        beside: Array | None = None,
    ) -> LocalSolve:
        """One local solve.

        Where the objective has kinks its smooth stand-in is solved first, and the program itself
        from there; should that fail, once more with wider bounds and from the start itself. What
        is smooth and fails is tried once more from a little beside.

        Args:
            start: joint positions to start from, (N,).
            parameters: of the object, see `object_parameters`.
            numbers: of the objective.
            lower: joint limits with margin, −inf where none, (N,).
            upper: alike.
            beside: where the variables that torque limits add start.
        """
        numbers = np.concatenate([parameters, numbers])
        more = np.zeros(0) if beside is None else beside
        if self._gram is not None and not np.all(np.isfinite(self.gram_at(start, parameters))):
            return _not_started(start)
        first = self._exact if self._smooth is None else self._smooth
        near = first.run(start, more, numbers, lower, upper)
        if not near.converged:
            nudge = _NUDGE * np.random.default_rng(0).normal(size=len(start))
            near = first.run(start + nudge, more, numbers, lower, upper)
        if self._smooth is None or not isinstance(self.objective, EllipsoidMeasure):
            return near
        if near.converged and self._at_ceiling(self.objective, near.q, parameters):
            return near
        attempts = [(near.q, _FIRST_SLACK), *((start, slack) for slack in _WIDER_SLACKS)]
        end = near
        for q, slack in attempts:
            gram = self.gram_at(q, parameters)
            if not np.all(np.isfinite(gram)) or np.linalg.cond(gram) > 1e13:
                end = _not_started(q)
                continue
            extra = np.concatenate([more, self.objective.extra_start(gram, slack)])
            end = self._exact.run(q, extra, numbers, lower, upper)
            if end.converged:
                break
        return end

    def _at_ceiling(self, objective: EllipsoidMeasure, q: Array, parameters: Array) -> bool:
        value = objective.of_grams(self.gram_at(q, parameters)[None])[0]
        return bool(value >= objective.ceiling - 1e-9)


def _not_started(q: Array) -> LocalSolve:
    return LocalSolve(q, False, "Singular_Start", {})
