"""What can be maximised: measures of the system's ellipsoid.

An objective is asked for in three ways: of a measured ellipsoid, with all its digits; of many Gram
matrices at once, to compare postures; and as what it adds to a program.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar

import casadi as ca
import numpy as np

from copose.capability import Ellipsoid, log_ball_volume, log_det
from copose.poses import Array
from copose.problem import Problem, TaskCompatibilityObjective


@dataclass(frozen=True, eq=False)
class Formulation:
    """What an objective adds to a program.

    Attributes:
        value: the expression to maximise; it grows with the objective.
        extra: variables beside the joints.
        zero: expressions that must vanish.
        smooth: where ``value`` has kinks, an expression without any whose maximum is near: a place
            to start from.
    """

    value: ca.SX
    extra: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    zero: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    smooth: ca.SX | None = None


class Objective(ABC):
    """A measure of the ellipsoid {a : aᵀG a ≤ 1}, larger is better.

    Attributes:
        kind: as written in a problem file.
        unit: of its value.
        numbers: parameters of its expressions, such as directions; they vary without rebuilding.
    """

    kind: ClassVar[str]
    ceiling: ClassVar[float] = np.inf
    """No posture is worth more."""

    def __init__(self, unit: str, numbers: Array | None = None) -> None:
        """An objective with its unit and parameters."""
        self.unit = unit
        self.numbers: Array = np.zeros(0) if numbers is None else numbers

    @abstractmethod
    def of(self, ellipsoid: Ellipsoid) -> float:
        """The value of a measured ellipsoid."""

    @abstractmethod
    def of_grams(self, grams: Array) -> Array:
        """Values of many Gram matrices (count, a, a); NaN or −inf where there is none."""

    @abstractmethod
    def formulate(self, gram: ca.SX, numbers: ca.SX) -> Formulation:
        """What to maximise in terms of G, (a, a), and of the parameters as symbols."""

    def extra_start(self, gram: Array, slack: float) -> Array:
        """Where the extra variables start at a posture with this G, bounds wide by ``slack``."""
        return np.zeros(0)


class Volume(Objective):
    """log-volume, −½ log det G + log(volume of the unit ball)."""

    kind = "volume"

    def of(self, ellipsoid: Ellipsoid) -> float:
        """From the semi-axes."""
        return ellipsoid.log_volume

    def of_grams(self, grams: Array) -> Array:
        """From the determinants."""
        sign, logs = np.linalg.slogdet(grams)
        return np.where(sign > 0, log_ball_volume(grams.shape[-1]) - logs / 2, -np.inf)

    def formulate(self, gram: ca.SX, numbers: ca.SX) -> Formulation:
        """Smooth as it is."""
        return Formulation(log_ball_volume(gram.shape[0]) - log_det(gram) / 2)


class TaskCompatibility(Objective):
    """Σ_j w_j log d(u_j), d(u) = (uᵀG u)^(−1/2) (after S. L. Chiu, 1988)."""

    kind = "task-compatibility"

    def __init__(self, unit: str, directions: Array, weights: Array) -> None:
        """Unit directions (k, a) and their weights (k,)."""
        super().__init__(unit, np.concatenate([directions.ravel(), weights]))
        self.directions, self.weights = directions, weights

    def of(self, ellipsoid: Ellipsoid) -> float:
        """From the radii along the directions."""
        radii = [ellipsoid.radius(u) for u in self.directions]
        return float(self.weights @ np.log(radii))

    def of_grams(self, grams: Array) -> Array:
        """From the quadratic forms."""
        forms = np.einsum("ka,nab,kb->nk", self.directions, grams, self.directions)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(-0.5 * np.log(forms) @ self.weights)

    def formulate(self, gram: ca.SX, numbers: ca.SX) -> Formulation:
        """Smooth as it is."""
        k, a = self.directions.shape
        value = ca.SX(0)
        for j in range(k):
            u = numbers[a * j : a * j + a]
            value -= numbers[k * a + j] * ca.log(ca.dot(u, gram @ u)) / 2
        return Formulation(value)


class WorstDirection(Objective):
    """The shortest semi-axis, λ_max(G)^(−1/2)."""

    kind = "worst-direction"

    def of(self, ellipsoid: Ellipsoid) -> float:
        """The last of the semi-axes."""
        return float(ellipsoid.radii[-1])

    def of_grams(self, grams: Array) -> Array:
        """From the largest eigenvalues."""
        return np.asarray(np.linalg.eigvalsh(grams)[:, -1] ** -0.5)

    def formulate(self, gram: ca.SX, numbers: ca.SX) -> Formulation:
        """Minimise s subject to G ⪯ eˢI: eigenvalues meet at the optimum, their bound is smooth."""
        s, extra, zero = _bound(gram)
        return Formulation(-s / 2, extra, zero, smooth=-_log_norm(gram) / 2)

    def extra_start(self, gram: Array, slack: float) -> Array:
        """A little above the largest eigenvalue."""
        return _bound_start(gram, slack)


class Isotropy(Objective):
    """Shortest over longest semi-axis, (λ_min/λ_max)^(1/2)."""

    kind = "isotropy"
    ceiling = 1.0

    def of(self, ellipsoid: Ellipsoid) -> float:
        """The last over the first of the semi-axes."""
        return float(ellipsoid.radii[-1] / ellipsoid.radii[0])

    def of_grams(self, grams: Array) -> Array:
        """From the extreme eigenvalues."""
        values = np.linalg.eigvalsh(grams)
        with np.errstate(invalid="ignore"):
            return np.asarray(np.sqrt(values[:, 0] / values[:, -1]))

    def formulate(self, gram: ca.SX, numbers: ca.SX) -> Formulation:
        """Minimise s + t subject to G ⪯ eˢI and G⁻¹ ⪯ eᵗI."""
        D, LT, order = ca.ldl(gram, False)
        inverse = ca.ldl_solve(ca.SX.eye(gram.shape[0]), D, LT, order)
        s, extra, zero = _bound(gram)
        t, more, also = _bound(inverse)
        return Formulation(
            -(s + t) / 2,
            ca.vertcat(extra, more),
            ca.vertcat(zero, also),
            smooth=-(_log_norm(gram) + _log_norm(inverse)) / 2,
        )

    def extra_start(self, gram: Array, slack: float) -> Array:
        """A little outside the extreme eigenvalues."""
        inverse = np.asarray(np.linalg.inv(gram), dtype=np.float64)
        return np.concatenate([_bound_start(gram, slack), _bound_start(inverse, slack)])


def _bound(G: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """G ⪯ eˢI as L Lᵀ = I − e⁻ˢG: s, the variables (s, L), and what must vanish.

    Bounds on the pivots of a factorisation fail where two eigenvalues meet, which they do at the
    optimum; the equation in L stays regular there (S. Burer, R. D. C. Monteiro, 2003).
    """
    a = G.shape[0]
    s, entries = ca.SX.sym("s"), ca.SX.sym("L", a * (a + 1) // 2)
    L = ca.SX(a, a)
    for k, (i, j) in enumerate(_lower_triangle(a)):
        L[i, j] = entries[k]
    gap = L @ L.T - (ca.SX.eye(a) - ca.exp(-s) * G)
    zero = ca.vertcat(*(gap[i, j] for i, j in _lower_triangle(a)))
    return s, ca.vertcat(s, entries), zero


def _bound_start(G: Array, slack: float) -> Array:
    """(s, L) of `_bound` with s above the logarithm of the largest eigenvalue by ``slack``."""
    symmetric = (G + G.T) / 2
    s = np.log(np.linalg.eigvalsh(symmetric)[-1]) + slack
    L = np.linalg.cholesky(np.eye(len(G)) - np.exp(-s) * symmetric)
    return np.array([s, *(L[i, j] for i, j in _lower_triangle(len(G)))])


def _lower_triangle(a: int) -> list[tuple[int, int]]:
    return [(i, j) for i in range(a) for j in range(i + 1)]


def _log_norm(G: ca.SX) -> ca.SX:
    """Log (tr G⁶⁴)^(1/64), at most log(a)/64 above the logarithm of the largest eigenvalue."""
    total, power = ca.log(ca.trace(G)), 1
    X = G / ca.trace(G)
    while power < 64:
        X, power = X @ X, 2 * power
        total += ca.log(ca.trace(X)) / power
        X = X / ca.trace(X)
    return total


def objective_of(problem: Problem) -> Objective:
    """The objective of a problem file."""
    spec = problem.objective
    length = acceleration_unit(problem)
    if isinstance(spec, TaskCompatibilityObjective):
        directions = np.array([problem.along(w.direction) for w in spec.directions])
        weights = np.array([w.weight for w in spec.directions])
        return TaskCompatibility("log", directions, weights)
    kinds: dict[str, Objective] = {
        "volume": Volume("log"),
        "worst-direction": WorstDirection(length),
        "isotropy": Isotropy("1"),
    }
    return kinds[spec.kind]


def acceleration_unit(problem: Problem) -> str:
    """The unit of a semi-axis: per unit torque, or at the torque limits."""
    linear = {"m/s²" for axis in problem.axes if axis in problem.space.linear}
    angular = {"rad/s²" for axis in problem.axes if axis in problem.space.angular}
    unit = ", ".join(sorted(linear) + sorted(angular))
    return unit if problem.ellipsoid.torque_scaling == "limits" else f"{unit} per N·m"
