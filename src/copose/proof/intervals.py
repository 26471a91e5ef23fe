"""Arrays of intervals as midpoints and radii, rounded outwards (S. M. Rump, 1999).

The error of a sum of k products is at most k times the unit roundoff times the sum of their sizes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from copose.poses import Array, Mask


@dataclass(frozen=True, eq=False)
class Interval:
    """Numbers within radii of midpoints, two arrays of one shape."""

    mid: Array
    rad: Array
    __array_ufunc__ = None

    @classmethod
    def exactly(cls, values: Array) -> Interval:
        """The numbers themselves."""
        return cls(values, np.zeros_like(values))

    @property
    def size(self) -> Array:
        """The largest absolute values."""
        return np.abs(self.mid) + self.rad

    def map(self, change: Any) -> Interval:
        """The same numbers in other places."""
        return Interval(change(self.mid), change(self.rad))

    def __add__(self, other: Any) -> Interval:
        o = _interval(other)
        return _rounded(self.mid + o.mid, self.rad + o.rad)

    def __neg__(self) -> Interval:
        return Interval(-self.mid, self.rad)

    def __sub__(self, other: Any) -> Interval:
        return self + (-_interval(other))

    def __mul__(self, other: Any) -> Interval:
        o = _interval(other)
        return _rounded(self.mid * o.mid, np.abs(self.mid) * o.rad + self.rad * o.size)

    def __matmul__(self, other: Any) -> Interval:
        o = _interval(other)
        mid, size = self.mid @ o.mid, np.abs(o.mid)
        roundings = (self.mid.shape[-1] + 1) * unit(mid)
        rad = np.abs(self.mid) @ (o.rad + roundings * size) + self.rad @ (size + o.rad)
        return Interval(mid, rad * (1 + 1e-12) + 1e-300)

    def __rmatmul__(self, other: Array) -> Interval:
        return _interval(other) @ self


def unit(values: Array) -> float:
    """The unit roundoff of the precision of numbers."""
    return float(np.finfo(values.dtype).eps) / 2


def _interval(x: Any) -> Interval:
    return x if isinstance(x, Interval) else Interval.exactly(np.asarray(x))


def _rounded(mid: Array, rad: Array) -> Interval:
    return Interval(mid, (rad + unit(mid) * np.abs(mid)) * (1 + 1e-12) + 1e-300)


def inverse(N: Interval) -> tuple[Interval, Mask]:
    """Inverses of matrices, and where all of an interval are proved to be regular.

    With X about the inverse of the midpoint, |N⁻¹ − X| ≤ (I − S)⁻¹S|X|, S = |X N − I|.
    """
    eye = np.eye(N.mid.shape[-1])
    sound = np.asarray(np.isfinite(N.mid + N.rad).all(axis=(1, 2)))
    mid = np.where(sound[:, None, None], N.mid, eye)
    sound &= np.asarray(np.linalg.cond(mid)) < 1e14
    mid = np.where(sound[:, None, None], mid, eye)
    X = np.asarray(np.linalg.inv(mid), dtype=np.float64)
    S = (X @ Interval(mid, N.rad) - eye).size
    sound &= S.sum(axis=2).max(axis=1) < 0.9
    S = np.where(sound[:, None, None], S, 0.0)
    return Interval(X, np.asarray(np.linalg.solve(eye - S, S @ np.abs(X))) * (1 + 1e-9)), sound
