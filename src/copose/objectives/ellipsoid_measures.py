"""What can be maximised, and of it what an ellipsoid tells.

A measure is asked for in three ways: of a measured ellipsoid, with all its digits; of many Gram
matrices at once, to compare postures; and as what it adds to a program.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import casadi as ca
import numpy as np

from copose.capability import (
    Ellipsoid,
    Form,
    Sums,
    log_ball_volume,
    log_det,
)
from copose.poses import Array


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
    """What is maximised over postures.

    Attributes:
        kind: as written in a problem file.
        unit: of its value.
        sums: what it takes from all arms together.
        scales: T by arm, in which these sums measure torques, (n,).
    """

    kind: str
    ceiling: ClassVar[float] = np.inf
    """No posture is worth more."""

    def __init__(self, kind: str, unit: str, sums: Sums, scales: Sequence[Array]) -> None:
        """An objective over some sums."""
        self.kind, self.unit, self.sums, self.scales = kind, unit, sums, tuple(scales)

    @abstractmethod
    def score(self, sums: ca.SX, M_o: ca.SX, numbers: ca.SX, axes: Sequence[int]) -> ca.SX:
        """The objective, or what stands in for it when postures are compared."""


class EllipsoidMeasure(Objective):
    """A measure of an ellipsoid {x : xᵀG x ≤ 1}, larger is better.

    Attributes:
        form: the ellipsoid's.
        numbers: parameters of its expressions, such as directions; they vary without rebuilding.
    """

    kinked: ClassVar[bool] = False
    """Whether it has kinks where it is largest."""

    def __init__(
        self,
        kind: str,
        unit: str,
        form: Form,
        scales: Sequence[Array],
        numbers: Array | None = None,
    ) -> None:
        """A measure with its unit and parameters."""
        super().__init__(kind, unit, form, scales)
        self.form = form
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

    def gram(self, sums: ca.SX, M_o: ca.SX, axes: Sequence[int]) -> ca.SX:
        """G of the stacked sums, its slice by the axes, (a, a)."""
        chosen = list(axes)
        return self.form.summed_gram(sums, M_o)[chosen, chosen]

    def score(self, sums: ca.SX, M_o: ca.SX, numbers: ca.SX, axes: Sequence[int]) -> ca.SX:
        """Itself, or its stand-in without kinks."""
        formulation = self.formulate(self.gram(sums, M_o, axes), numbers)
        return formulation.value if formulation.smooth is None else formulation.smooth


class Volume(EllipsoidMeasure):
    """log-volume, −½ log det G + log(volume of the unit ball)."""

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


class TaskCompatibility(EllipsoidMeasure):
    """Σ_j w_j log d(u_j), d(u) = (uᵀG u)^(−1/2) (after S. L. Chiu, 1988)."""

    def __init__(
        self, form: Form, scales: Sequence[Array], directions: Array, weights: Array
    ) -> None:
        """Unit directions (k, a) and their weights (k,)."""
        numbers = np.concatenate([directions.ravel(), weights])
        super().__init__("task-compatibility", "log", form, scales, numbers)
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


class WorstDirection(EllipsoidMeasure):
    """The shortest semi-axis, λ_max(G)^(−1/2)."""

    kinked = True

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


class Isotropy(EllipsoidMeasure):
    """Shortest over longest semi-axis, (λ_min/λ_max)^(1/2)."""

    kinked = True
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
