"""The straightforward program of a case: one CasADi SX graph handed to IPOPT.

Minimise −objective(q) subject to closure and joint limits, the pose of the object a parameter.
Objectives with kinks get a bound that is smooth where two eigenvalues meet: G ⪯ eˢI as
L Lᵀ = I − e⁻ˢG (S. Burer, R. D. C. Monteiro, 2003).
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from cases import Case
from truth import Array

from copose.capability import RESOLUTIONS, log_ball_volume, log_det
from copose.mechanics import System, object_parameters
from copose.poses import Pose
from copose.robots import load_arms

_OPTIONS: dict[str, Any] = {
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.tol": 1e-9,
    "ipopt.constr_viol_tol": 1e-10,
    "ipopt.bound_relax_factor": 0.0,
    "ipopt.acceptable_iter": 0,
    "ipopt.max_iter": 300,
    "print_time": False,
    "show_eval_warnings": False,
    "error_on_fail": False,
}
_WARM: dict[str, Any] = {
    "ipopt.warm_start_init_point": "yes",
    "ipopt.mu_init": 1e-6,
    "ipopt.warm_start_bound_push": 1e-9,
    "ipopt.warm_start_bound_frac": 1e-9,
    "ipopt.warm_start_slack_bound_push": 1e-9,
    "ipopt.warm_start_slack_bound_frac": 1e-9,
    "ipopt.warm_start_mult_bound_push": 1e-9,
}
# How far above the largest eigenvalue its bound starts, in logarithms.
_SLACK = 0.05


@dataclass(frozen=True, eq=False)
class End:
    """Where a local solve ended: stacked joints, whether it met its tolerance, what to go on from.

    Attributes:
        q: joint positions of all arms, stacked, (N,).
        converged: whether the method says so.
        status: in the method's words.
        state: variables and multipliers, for a warm start.
    """

    q: Array
    converged: bool
    status: str
    state: dict[str, Array] = field(default_factory=dict)


class PlainProgram:
    """One graph of a case, built once; what varies is where the object is and where to start.

    Attributes:
        lower: joint limits, margin kept, (N,); ``upper`` alike.
    """

    def __init__(self, case: Case, hessian: str) -> None:
        """Write the graph down.

        Args:
            case: the problem.
            hessian: ``exact`` or ``limited-memory``.
        """
        problem = case.problem
        arms = load_arms(problem)
        system = System.of(problem.space, arms, problem.ellipsoid.load_distribution)
        efforts = problem.ellipsoid.torque_scaling == "limits"
        scales = [
            np.array([joint.effort if efforts else 1.0 for joint in arm.joints]) for arm in arms
        ]
        axes = list(problem.axes)
        G = RESOLUTIONS[problem.ellipsoid.resolution].system_gram(system, scales)[axes, axes]
        margin = problem.constraints.joint_margin
        self.lower = np.concatenate([arm.lower for arm in arms]) + margin
        self.upper = np.concatenate([arm.upper for arm in arms]) - margin
        self._mass = problem.object.mass
        inertia = problem.object.inertia
        self._inertia = inertia if inertia is not None else 0.0
        self._nominal = problem.object.pose
        value, self._extra, zero = _formulate(problem, G)
        closure = [system.closure(i) for i in range(len(arms))]
        self._graph = {
            "x": ca.vertcat(system.q, self._extra),
            "p": system.object.parameters,
            "f": -value,
            "g": ca.vertcat(*closure, zero),
        }
        self._gram = ca.Function("gram", [system.q, system.object.parameters], [G])
        self._kind = case.kind
        self._options = dict(_OPTIONS)
        if hessian == "limited-memory":
            self._options["ipopt.hessian_approximation"] = "limited-memory"
        began = time.perf_counter()
        self._solver = ca.nlpsol("plain", "ipopt", self._graph, self._options)
        self.nlpsol_s = time.perf_counter() - began

    @cached_property
    def _warm_solver(self) -> Any:
        return ca.nlpsol("warm", "ipopt", self._graph, self._options | _WARM)

    def prepare_warm(self) -> None:
        """Build what warm solves need, so that none of them pays for it."""
        _ = self._warm_solver

    def parameters(self, pose: Pose | None = None) -> Array:
        """The object's numbers at a pose, by default the problem's."""
        where = self._nominal if pose is None else pose
        return object_parameters(where, self._mass, self._inertia)

    def solve(self, start: Array, pose: Pose | None = None, warm: End | None = None) -> End:
        """One run of IPOPT from stacked joints; from a former end's variables and multipliers."""
        p = self.parameters(pose)
        free = np.full(self._extra.numel(), np.inf)
        bounds = {
            "lbx": np.concatenate([self.lower, -free]),
            "ubx": np.concatenate([self.upper, free]),
            "lbg": 0.0,
            "ubg": 0.0,
            "p": p,
        }
        if warm is not None and warm.state:
            solver, begin = self._warm_solver, warm.state
        else:
            solver = self._solver
            gram = np.array(self._gram(start, p))
            if not np.all(np.isfinite(gram)):
                return End(start, False, "singular start")
            begin = {"x0": np.concatenate([start, _extra_start(self._kind, gram)])}
        answer = solver(**bounds, **begin)
        status = str(solver.stats()["return_status"])
        x, lam_x, lam_g = (np.array(answer[key]).ravel() for key in ("x", "lam_x", "lam_g"))
        q = np.clip(x[: len(start)], self.lower, self.upper)
        state = {"x0": x, "lam_x0": lam_x, "lam_g0": lam_g}
        return End(q, status == "Solve_Succeeded", status, state)


def _formulate(problem: Any, G: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """What to maximise, the variables beside the joints, what must vanish."""
    nothing, wanted = ca.SX(0, 1), problem.objective
    if wanted.kind == "volume":
        return log_ball_volume(G.shape[0]) - log_det(G) / 2, nothing, nothing
    if wanted.kind == "task-compatibility":
        value = ca.SX(0)
        for weighted in wanted.directions:
            u = ca.DM(problem.along(weighted.direction))
            value -= weighted.weight * ca.log(ca.dot(u, G @ u)) / 2
        return value, nothing, nothing
    s, extra, zero = _bound(G)
    if wanted.kind == "worst-direction":
        return -s / 2, extra, zero
    D, LT, order = ca.ldl(G, False)
    t, more, also = _bound(ca.ldl_solve(ca.SX.eye(G.shape[0]), D, LT, order))
    return -(s + t) / 2, ca.vertcat(extra, more), ca.vertcat(zero, also)


def _bound(G: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """The bound s with G ⪯ eˢI, the variables (s, L), and what must vanish."""
    a = G.shape[0]
    s, entries = ca.SX.sym("s"), ca.SX.sym("L", a * (a + 1) // 2)
    L = ca.SX(ca.Sparsity.lower(a), entries)
    gap = L @ L.T - (ca.SX.eye(a) - ca.exp(-s) * G)
    return (
        s,
        ca.vertcat(s, entries),
        ca.vertcat(*(gap[i, j] for j in range(a) for i in range(j, a))),
    )


def _extra_start(kind: str, gram: Array) -> Array:
    if kind not in ("worst-direction", "isotropy"):
        return np.zeros(0)
    parts = [gram] if kind == "worst-direction" else [gram, np.linalg.inv(gram)]
    found = []
    for part in parts:
        part = (part + part.T) / 2
        s = np.log(np.linalg.eigvalsh(part)[-1]) + _SLACK
        L = np.linalg.cholesky(np.eye(len(part)) - np.exp(-s) * part)
        found += [s, *(L[i, j] for j in range(len(L)) for i in range(j, len(L)))]
    return np.array(found)
