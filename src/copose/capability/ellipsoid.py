"""The ellipsoid as a value."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from copose.poses import Array, frozen_array


def log_ball_volume(m: int) -> float:
    """Log of the volume of the unit m-ball, π^(m/2) / Γ(m/2 + 1)."""
    return m / 2 * math.log(math.pi) - math.lgamma(m / 2 + 1)


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """{a : (a − c)ᵀ G (a − c) ≤ 1}.

    Attributes:
        gram: G, symmetric positive definite, (m, m).
        center: c, (m,).
        radii: semi-axes, longest first, (m,).
        axes: their directions, one unit vector a row, (m, m); largest entry positive.
    """

    gram: Array
    center: Array
    radii: Array
    axes: Array

    @classmethod
    def from_factor(cls, factor: ArrayLike, center: ArrayLike | None = None) -> Ellipsoid:
        """{a : ‖A (a − c)‖ ≤ 1}, G = AᵀA, from the singular values of A.

        They keep all digits of the longest semi-axes, which the eigenvalues of G lose.

        Raises:
            ValueError: A is not finite or has a rank below its number of columns.
        """
        A = np.asarray(factor, dtype=float)
        if not np.all(np.isfinite(A)):
            raise ValueError("the factor of an ellipsoid must be finite")
        m = A.shape[1]
        _, values, rows = np.linalg.svd(A, full_matrices=False)
        if A.shape[0] < m or values[-1] <= 1e-15 * values[0]:
            raise ValueError("the ellipsoid is unbounded: its factor lacks rank")
        radii, axes = 1 / values[::-1], rows[::-1]
        largest = np.argmax(np.abs(axes), axis=1)
        axes = axes * np.sign(axes[np.arange(m), largest])[:, None]
        c = np.zeros(m) if center is None else np.asarray(center, dtype=float)
        if not np.all(np.isfinite(c)):
            raise ValueError("the centre of an ellipsoid must be finite")
        return cls(frozen_array(A.T @ A), frozen_array(c), frozen_array(radii), frozen_array(axes))

    @property
    def log_volume(self) -> float:
        """−½ log det G + log(volume of the unit ball)."""
        return float(np.sum(np.log(self.radii))) + log_ball_volume(len(self.radii))

    def radius(self, direction: ArrayLike) -> float:
        """Distance from the centre to the surface along a direction: (uᵀ G u)^(−1/2)."""
        return float(1 / np.linalg.norm(self.axes @ _unit(direction) / self.radii))

    def support(self, direction: ArrayLike) -> float:
        """Max of uᵀa over the ellipsoid: cᵀu + (uᵀ G⁻¹ u)^(1/2)."""
        u = _unit(direction)
        return float(self.center @ u + np.linalg.norm(self.axes @ u * self.radii))

    def contains(self, points: ArrayLike, tolerance: float = 0.0) -> np.ndarray:
        """A mask of the points, (..., m), that are inside: ‖A (a − c)‖ ≤ 1 + tolerance."""
        offset = np.asarray(points, dtype=float) - self.center
        norms = np.linalg.norm(offset @ self.axes.T / self.radii, axis=-1)
        return np.asarray(norms <= 1 + tolerance)

    def boundary(self, directions: ArrayLike) -> Array:
        """Points of the surface: the unit ball's at ``directions``, (..., m), mapped to it."""
        unit = np.asarray(directions, dtype=float)
        unit = unit / np.linalg.norm(unit, axis=-1, keepdims=True)
        return np.asarray(self.center + unit * self.radii @ self.axes)

    def sliced(self, indices: Sequence[int]) -> Ellipsoid:
        """The slice of the centred ellipsoid in which all other coordinates are zero."""
        chosen = list(indices)
        factor = (self.axes / self.radii[:, None])[:, chosen]
        return Ellipsoid.from_factor(factor, self.center[chosen])

    def section(self, indices: Sequence[int]) -> Ellipsoid | None:
        """The points of this ellipsoid, where it is, whose other coordinates are zero.

        None where there are none. Unlike `sliced` it is smaller the farther off the centre is.
        """
        chosen = list(indices)
        factor = self.axes / self.radii[:, None]
        offset = factor @ self.center
        # ‖A_x x − A c‖² = ‖A_x (x − x₀)‖² + what no x takes away.
        x, *_ = np.linalg.lstsq(factor[:, chosen], offset)
        left = 1 - float(np.sum((factor[:, chosen] @ x - offset) ** 2))
        if left <= 0:
            return None
        return Ellipsoid.from_factor(factor[:, chosen] / math.sqrt(left), x)


def _unit(direction: ArrayLike) -> Array:
    u = np.asarray(direction, dtype=float)
    norm = float(np.linalg.norm(u))
    if not (math.isfinite(norm) and norm > 0):
        raise ValueError("a direction must be finite and not zero")
    return u / norm
