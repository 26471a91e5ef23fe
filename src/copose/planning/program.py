"""The posture program: maximise an objective over all joint positions under hard constraints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from copose.mechanics import System
from copose.planning.hessian import differenced_hessian
from copose.planning.objectives import Objective
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
class Constraint:
    """lower ≤ expression ≤ upper, with a name to report it by."""

    name: str
    expression: ca.SX
    lower: Array
    upper: Array
    unit: str


def equality(name: str, expression: ca.SX, unit: str) -> Constraint:
    """The constraint that an expression vanishes."""
    zero = np.zeros(expression.numel())
    return Constraint(name, expression, zero, zero, unit)


def closure_constraints(system: System) -> tuple[Constraint, ...]:
    """Every tip at its grasp: the residuals of `System.closure` are zero."""
    unit = "m, rad" if system.space.rigid else "m"
    return tuple(
        equality(f"closure of arm {arm.arm.name}", system.closure(i), unit)
        for i, arm in enumerate(system.arms)
    )


@dataclass(frozen=True, eq=False)
class LocalSolve:
    """How one run of IPOPT ended.

    Attributes:
        q: joint positions of all arms, stacked, (N,).
        converged: whether IPOPT met its tolerance.
        status: in IPOPT's words.
        violations: the largest violation of each constraint, by name.
    """

    q: Array
    converged: bool
    status: str
    violations: dict[str, float]


class _Solver:
    """IPOPT on: minimise −value subject to constraints and bounds on the joints."""

    def __init__(
        self,
        variables: tuple[ca.SX, ca.SX],
        parameters: ca.SX,
        value: ca.SX,
        constraints: tuple[Constraint, ...],
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
        hessian = differenced_hessian(self.expressions, variables[0].numel())
        options = _IPOPT | {"hess_lag": hessian}
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
        )


class PostureProgram:
    """minimise −objective(q; object, numbers) subject to closure and joint limits.

    Object pose, mass, inertia and the objective's numbers (directions, weights) are parameters and
    limits are bounds: building is done once, in the constructor, and every `solve` only solves.

    Attributes:
        objective: what is maximised.
        constraints: what holds at every solution.
        rows: which rows of the stacked constraints each of them is, by name.
        expressions: the program as ``x``, ``p``, ``f`` and ``g``.
    """

    def __init__(self, system: System, gram: ca.SX, objective: Objective) -> None:
        """Build the program of a system for one objective of its Gram matrix G, (a, a)."""
        self.objective = objective
        numbers = ca.SX.sym("numbers", len(objective.numbers))
        parameters = ca.vertcat(system.object.parameters, numbers)
        formulation = objective.formulate(gram, numbers)
        closure = closure_constraints(system)
        self.constraints = closure
        if formulation.zero.numel():
            self.constraints += (equality("bounds on the semi-axes", formulation.zero, "1"),)
        self._exact = _Solver(
            (system.q, formulation.extra), parameters, formulation.value, self.constraints
        )
        self._smooth = None
        if formulation.smooth is not None:
            nothing = ca.SX(0, 1)
            self._smooth = _Solver((system.q, nothing), parameters, formulation.smooth, closure)
        self._gram = ca.Function("gram", [system.q, system.object.parameters], [gram])
        self.rows, self.expressions = self._exact.rows, self._exact.expressions

    def gram_at(self, q: Array, parameters: Array) -> Array:
        """G of stacked joint positions, (a, a)."""
        return np.array(self._gram(q, parameters))

    def solve(self, start: Array, parameters: Array, lower: Array, upper: Array) -> LocalSolve:
        """One local solve.

        Where the objective has kinks its smooth stand-in is solved first, and the program itself
        from there; should that fail, once more with wider bounds and from the start itself. A
        smooth objective that fails is tried once more from a little beside.

        Args:
            start: joint positions to start from, (N,).
            parameters: of the object, see `object_parameters`.
            lower: joint limits with margin, −inf where none, (N,).
            upper: alike.
        """
        numbers = np.concatenate([parameters, self.objective.numbers])
        if self._smooth is None:
            if not np.all(np.isfinite(self.gram_at(start, parameters))):
                return _not_started(start)
            end = self._exact.run(start, np.zeros(0), numbers, lower, upper)
            if end.converged:
                return end
            nudge = _NUDGE * np.random.default_rng(0).normal(size=len(start))
            return self._exact.run(start + nudge, np.zeros(0), numbers, lower, upper)
        near = self._smooth.run(start, np.zeros(0), numbers, lower, upper)
        if near.converged and self._at_ceiling(near.q, parameters):
            return near
        attempts = [(near.q, _FIRST_SLACK), *((start, slack) for slack in _WIDER_SLACKS)]
        end = near
        for q, slack in attempts:
            gram = self.gram_at(q, parameters)
            if not np.all(np.isfinite(gram)) or np.linalg.cond(gram) > 1e13:
                end = _not_started(q)
                continue
            extra = self.objective.extra_start(gram, slack)
            end = self._exact.run(q, extra, numbers, lower, upper)
            if end.converged:
                break
        return end

    def _at_ceiling(self, q: Array, parameters: Array) -> bool:
        value = self.objective.of_grams(self.gram_at(q, parameters)[None])[0]
        return bool(value >= self.objective.ceiling - 1e-9)


def _not_started(q: Array) -> LocalSolve:
    return LocalSolve(q, False, "Singular_Start", {})
