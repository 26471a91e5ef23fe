"""The posture program: maximise an objective over all joint positions under hard constraints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from copose.capability import gram, torque_maps
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
    "ipopt.max_iter": 300,
    "print_time": False,
    "calc_lam_p": False,
    "show_eval_warnings": False,
    "error_on_fail": False,
}


@dataclass(frozen=True, eq=False)
class Constraint:
    """lower ≤ expression ≤ upper, with a name to report it by."""

    name: str
    expression: ca.SX
    lower: Array
    upper: Array
    unit: str


def closure_constraints(system: System) -> tuple[Constraint, ...]:
    """Every tip at its grasp: the residuals of `System.closure` are zero."""
    zero = np.zeros(system.space.m)
    unit = "m, rad" if system.space.rigid else "m"
    return tuple(
        Constraint(f"closure of arm {arm.arm.name}", system.closure(i), zero, zero, unit)
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


class PostureProgram:
    """minimise −objective(q; object) subject to closure and joint limits.

    Object pose, mass and inertia are parameters and limits are bounds: building is done once, in
    the constructor, and every `solve` only solves.

    Attributes:
        objective: what is maximised.
        constraints: what holds at every solution.
        rows: which rows of the stacked constraints each of them is, by name.
    """

    def __init__(self, system: System, objective: Objective) -> None:
        """Build the program of a system for one objective."""
        self.objective = objective
        self.constraints = closure_constraints(system)
        edges = np.cumsum([0] + [c.expression.shape[0] for c in self.constraints])
        self.rows = {
            c.name: slice(int(start), int(stop))
            for c, start, stop in zip(self.constraints, edges[:-1], edges[1:], strict=True)
        }
        system_gram = sum(
            (gram(block) for block in torque_maps(system)), ca.SX(system.space.m, system.space.m)
        )
        value = objective.expression(system_gram)
        stacked = ca.vertcat(*(c.expression for c in self.constraints))
        nlp: dict[str, ca.SX] = {
            "x": system.q,
            "p": system.object.parameters,
            "f": -value,
            "g": stacked,
        }
        self.expressions = nlp
        self._lower = np.concatenate([c.lower for c in self.constraints])
        self._upper = np.concatenate([c.upper for c in self.constraints])
        options = _IPOPT | {"hess_lag": differenced_hessian(nlp)}
        self._solver = ca.nlpsol("posture", "ipopt", nlp, options)

    def solve(self, start: Array, parameters: Array, lower: Array, upper: Array) -> LocalSolve:
        """One local solve.

        Args:
            start: joint positions to start from, (N,).
            parameters: of the object, see `object_parameters`.
            lower: joint limits with margin, −inf where none, (N,).
            upper: alike.
        """
        answer = self._solver(
            x0=start, p=parameters, lbx=lower, ubx=upper, lbg=self._lower, ubg=self._upper
        )
        stats = self._solver.stats()
        values = np.array(answer["g"]).ravel()
        excess = np.maximum(np.maximum(self._lower - values, values - self._upper), 0.0)
        return LocalSolve(
            q=np.clip(np.array(answer["x"]).ravel(), lower, upper),
            converged=bool(stats["success"]),
            status=str(stats["return_status"]),
            violations={name: float(excess[rows].max()) for name, rows in self.rows.items()},
        )
