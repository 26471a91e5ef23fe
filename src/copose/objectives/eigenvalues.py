"""Objectives on the extreme eigenvalues of G: the shortest semi-axis, and isotropy."""

from __future__ import annotations

import casadi as ca
import numpy as np

from copose.capability import Ellipsoid
from copose.capability.sums import extreme_vector, traces
from copose.constraints.constraint import equality
from copose.objectives.ellipsoid import EllipsoidMeasure
from copose.objectives.objective import Term
from copose.poses import Array


class WorstDirection(EllipsoidMeasure):
    """The shortest semi-axis, λ_max(G)^(−1/2)."""

    non_smooth = True

    def of(self, ellipsoid: Ellipsoid) -> float:
        """The last of the semi-axes."""
        return float(ellipsoid.radii[-1])

    def of_grams(self, grams: Array) -> Array:
        """Values by the largest eigenvalues."""
        return np.asarray(np.linalg.eigvalsh(grams)[:, -1] ** -0.5)

    def upper_bounds(self, corners: Array, M_o: Array) -> Array:
        """λ_max(G) ≥ vᵀG v, v its vector in the middle."""
        least = traces(extreme_vector(corners[:, 0].mean(axis=0), -1), corners[:, 0]).min(axis=0)
        return np.asarray(np.where(least > 0, least, np.nan) ** -0.5)

    def formulate(self, gram: ca.SX, numbers: ca.SX) -> Term:
        """Minimise s subject to G ⪯ eˢI: eigenvalues meet at the optimum, their bound is smooth."""
        s, variables, zero = _bound(gram)
        return _sharpened(-_log_norm(gram) / 2, -s / 2, variables, zero, gram)

    def sharp_start(self, gram: Array, slack: float) -> Array:
        """A start a little above the largest eigenvalue."""
        return _bound_start(gram, slack)


class Isotropy(EllipsoidMeasure):
    """Shortest over longest semi-axis, (λ_min/λ_max)^(1/2)."""

    non_smooth = True
    ceiling = 1.0

    def of(self, ellipsoid: Ellipsoid) -> float:
        """The last over the first of the semi-axes."""
        return float(ellipsoid.radii[-1] / ellipsoid.radii[0])

    def of_grams(self, grams: Array) -> Array:
        """Values by the extreme eigenvalues."""
        values = np.linalg.eigvalsh(grams)
        with np.errstate(invalid="ignore"):
            return np.asarray(np.sqrt(values[:, 0] / values[:, -1]))

    def bound_sides(self, *, sliced: bool) -> tuple[tuple[int, bool], ...]:
        """G from both sides."""
        return ((0, False), (0, True)) if self.form.n_terms == 1 else ()

    def upper_bounds(self, corners: Array, M_o: Array) -> Array:
        """λ_min ≤ uᵀG u and λ_max ≥ vᵀG v, u and v their vectors in the middle; a quotient of
        linear functions is largest at a corner.
        """
        above, below = (traces(extreme_vector(corners[:, side].mean(axis=0), side - 1),
                               corners[:, side]) for side in (1, 0))  # fmt: skip
        quotient = np.where((below > 0) & (above > 0), above, np.nan) / np.abs(below)
        return np.asarray(np.sqrt(quotient.max(axis=0)))

    def formulate(self, gram: ca.SX, numbers: ca.SX) -> Term:
        """Minimise s + t subject to G ⪯ eˢI and G⁻¹ ⪯ eᵗI."""
        D, LT, order = ca.ldl(gram, False)
        inverse = ca.ldl_solve(ca.SX.eye(gram.shape[0]), D, LT, order)
        s, above, zero = _bound(gram)
        t, below, nought = _bound(inverse)
        return _sharpened(
            -(_log_norm(gram) + _log_norm(inverse)) / 2,
            -(s + t) / 2,
            ca.vertcat(above, below),
            ca.vertcat(zero, nought),
            gram,
        )

    def sharp_start(self, gram: Array, slack: float) -> Array:
        """A start a little outside the extreme eigenvalues."""
        inverse = np.asarray(np.linalg.inv(gram), dtype=np.float64)
        return np.concatenate([_bound_start(gram, slack), _bound_start(inverse, slack)])


def _sharpened(stand_in: ca.SX, value: ca.SX, variables: ca.SX, zero: ca.SX, gram: ca.SX) -> Term:
    """The term of an objective with kinks, whose logarithm is maximised.

    The stand-in has no kinks and a maximum near. The logarithm takes variables of which ``zero``
    must vanish.
    """
    bounds = equality("bounds on the semi-axes", zero, "1")
    sharp = Term(value, ca.exp(value), variables, (bounds,), gram=gram)
    return Term(stand_in, ca.exp(stand_in), ca.SX(0, 1), sharp=sharp, gram=gram)


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
