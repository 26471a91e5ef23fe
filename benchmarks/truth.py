"""What answers are judged by: closure, limits and objective recomputed without copose's planning.

URDF arms go through Pinocchio and planar arms through sums over their links, by the formulas of
`tests/reference.py`; here they are written for many postures at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from building import Joints, Tables
from cases import Case
from numpy.typing import NDArray

from copose.robots import load_arms
from reference import Problem as Reference
from reference import pose

Array = NDArray[np.float64]


def objective_of(tables: Tables, grams: Array) -> Array:
    """Values of Gram matrices (count, a, a) of the ellipsoid's slice; −inf where there is none.

    volume −½ log det G + log(volume of the a-ball); task-compatibility −½ Σ w log uᵀG u;
    worst-direction λ_max(G)^(−1/2); isotropy (λ_min/λ_max)^(1/2).
    """
    wanted = tables.get("objective", {})
    kind, a = wanted.get("kind", "volume"), grams.shape[-1]
    with np.errstate(all="ignore"):
        if kind == "volume":
            sign, logs = np.linalg.slogdet(grams)
            ball = a / 2 * math.log(math.pi) - math.lgamma(a / 2 + 1)
            values = np.where(sign > 0, ball - logs / 2, -np.inf)
        elif kind == "task-compatibility":
            values = np.zeros(len(grams))
            for weighted in wanted["directions"]:
                u = np.array(weighted["direction"], dtype=float)
                u /= np.linalg.norm(u)
                form = np.einsum("nab,a,b->n", grams, u, u)
                values -= weighted.get("weight", 1.0) / 2 * np.log(form)
        else:
            eigenvalues = np.linalg.eigvalsh(grams)
            values = eigenvalues[:, -1] ** -0.5
            if kind == "isotropy":
                values = values * np.sqrt(eigenvalues[:, 0])
    return np.where(np.isfinite(values), values, -np.inf)


@dataclass(frozen=True)
class Judged:
    """An answer recomputed.

    Attributes:
        objective: its value.
        closure: the largest closure error of an arm, m or rad.
        beyond: the farthest that a joint is beyond its limits, rad or m.
    """

    objective: float
    closure: float
    beyond: float


class Truth:
    """A case as numpy and Pinocchio see it.

    Attributes:
        tables: of the problem.
        names: of the arms.
        reference: the independent model of `tests/reference.py`.
        lower: by arm, lowest joint positions, margin kept, −inf where none; ``upper`` alike.
        axes: indices of the task coordinates that the ellipsoid keeps.
    """

    def __init__(self, case: Case) -> None:
        """Read the robots of a case."""
        problem = case.problem
        arms = load_arms(problem)
        margin = problem.constraints.joint_margin
        self.tables: Tables = case.tables
        self.names = [arm.name for arm in arms]
        self.reference = Reference(case.tables, {a.name: list(a.joint_names) for a in arms})
        self.lower = [arm.lower + margin for arm in arms]
        self.upper = [arm.upper - margin for arm in arms]
        self.revolute = [np.array([j.kind == "revolute" for j in arm.joints]) for arm in arms]
        self.axes = list(problem.axes)
        settings = case.tables.get("ellipsoid", {})
        self.optimal = settings.get("resolution", "pseudoinverse") == "torque-optimal"
        self.scales = np.split(self.reference.limits(), np.cumsum([arm.n for arm in arms])[:-1])
        self.place(self.reference.object)

    def place(self, where: Any) -> None:
        """Put the object somewhere else (a `pinocchio.SE3`); inertia and contacts follow."""
        reference, rows = self.reference, self.reference.rows
        m = len(rows)
        full, R = np.zeros((6, 6)), reference.object.rotation
        full[np.ix_(rows, rows)] = reference.M_o
        turn = where.rotation @ R.T
        full[3:, 3:] = turn @ full[3:, 3:] @ turn.T
        reference.object, reference.M_o = where, full[np.ix_(rows, rows)]
        tables = reference.tables["arms"]
        self.goals = [where * pose(table["grasp"]) for table in tables]
        self.W = [reference.W(table) for table in tables]
        W = np.hstack(self.W)
        pinv = np.linalg.pinv(W)
        if self.tables.get("ellipsoid", {}).get("load_distribution") == "nonsqueezing":
            pinv = np.vstack([np.linalg.inv(block) for block in self.W]) / len(self.W)
        self.W_pinv = [pinv[m * i : m * i + m] for i in range(len(self.W))]

    def terms(self, i: int, J: Array, M: Array) -> Array:
        """What arm i adds to the sums that G is made of, (count, 1 or 2, m, m).

        The paper's: A_iᵀT⁻²A_i with A_i = M J⁺W_iᵀ + JᵀW⁺_iM_o; torque-optimal: W_iΛ_iW_iᵀ and
        W_iΛ_iJ_iM_i⁻¹T_i²M_i⁻¹J_iᵀΛ_iW_iᵀ.

        Args:
            i: which arm.
            J: its Jacobians in task rows, (count, m, n).
            M: its joint inertias, (count, n, n).
        """
        W, T = self.W[i], self.scales[i]
        Jt = np.swapaxes(J, 1, 2)
        if self.optimal:
            Y = np.linalg.solve(M, Jt)
            L = W @ np.linalg.inv(J @ Y)
            S = L @ W.T
            P = L @ np.swapaxes(Y, 1, 2) * T
            return np.stack([(S + np.swapaxes(S, 1, 2)) / 2, P @ np.swapaxes(P, 1, 2)], 1)
        Q, U = np.linalg.qr(Jt)
        own = np.swapaxes(np.linalg.solve(U, np.swapaxes(M @ Q, 1, 2)), 1, 2)
        A = (own @ W.T + Jt @ (self.W_pinv[i] @ self.reference.M_o)) / T[:, None]
        return (np.swapaxes(A, 1, 2) @ A)[:, None]

    def grams(self, sums: Array) -> Array:
        """G's slice of summed terms (count, 1 or 2, m, m) as (count, a, a)."""
        G = sums[:, 0]
        if self.optimal:
            S = sums[:, 0] + self.reference.M_o
            G = S @ np.linalg.solve(sums[:, 1], S)
            G = (G + np.swapaxes(G, 1, 2)) / 2
        return G[:, self.axes][:, :, self.axes]

    def values(self, sums: Array) -> Array:
        """The objective of summed terms, (count,)."""
        return objective_of(self.tables, self.grams(sums))

    def arm_matrices(self, i: int, q: Array) -> tuple[Array, Array]:
        """J in task rows, (count, m, n), and M, (count, n, n), of postures (count, n) of arm i."""
        arm, rows = self.reference.arms[self.names[i]], self.reference.rows
        found = [arm.at(row)[1:3] for row in q]
        return np.array([J[rows] for J, _ in found]), np.array([M for _, M in found])

    def judge(self, joints: Joints) -> Judged:
        """An answer recomputed from its joints, its ellipsoid by the reference's own formulas."""
        factor, _ = self.reference.ellipsoid(joints)
        own = self.reference.at(joints)
        beyond = 0.0
        for name, low, high in zip(self.names, self.lower, self.upper, strict=True):
            q = np.array(joints[name])
            beyond = max(beyond, float(np.max(low - q)), float(np.max(q - high)))
        value = float(objective_of(self.tables, (factor.T @ factor)[None])[0])
        return Judged(value, max(own.closure.values()), beyond)

    def split(self, q: Array) -> Joints:
        """Stacked joint positions by arm."""
        parts = np.split(q, np.cumsum([len(low) for low in self.lower])[:-1])
        return {name: part.tolist() for name, part in zip(self.names, parts, strict=True)}


@cache
def truth_of(case: Case) -> Truth:
    """The truth about a case, read once."""
    return Truth(case)
