"""Taylor models of order one along a curve: value and slope in its middle, curvature all over."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from operator import matmul, mul
from typing import Any

import numpy as np

from copose.poses import Array, Mask
from copose.proof.intervals import Interval, inverse, unit


class Taylor:
    """Enclosures of f(0), f′(0), and of f″(t)/2 for all |t| ≤ h, of arrays f, (count, …).

    Attributes:
        parts: these three, (3, count, …).
        h: half of the lengths of the segments, (count,).
    """

    __array_ufunc__ = None

    def __init__(self, parts: Interval, h: Array) -> None:
        """Models by their parts."""
        self.parts, self.h = parts, h
        self.value, self.slope, self.curvature = (parts.map(lambda x, k=k: x[k]) for k in range(3))

    @classmethod
    def of(cls, parts: Sequence[Interval], h: Array) -> Taylor:
        """Models by values, slopes and curvatures."""
        mid, rad = (np.stack([getattr(x, name) for x in parts]) for name in ("mid", "rad"))
        return cls(Interval(mid, rad), h)

    @classmethod
    def fixed(cls, value: Interval | Array, h: Array) -> Taylor:
        """Numbers that do not change, (count, …), or the same on all segments, (1, …)."""
        value = value if isinstance(value, Interval) else Interval.exactly(value)
        value = value.map(lambda x: np.broadcast_to(x, (len(h), *x.shape[1:])).astype(h.dtype))
        zero = Interval.exactly(np.zeros_like(value.mid))
        return cls.of([value, zero, zero], h)

    @property
    def _half(self) -> Array:
        """Half lengths of the segments, in the dimensions of values."""
        return self.h.reshape(-1, *[1] * (self.value.mid.ndim - 1))

    @cached_property
    def whole(self) -> Interval:
        """Enclosure of the values on the segment."""
        h, nothing = self._half, np.zeros_like(self.value.mid)
        square = Interval(h**2 / 2, h**2 / 2)
        return self.value + self.curvature * square + Interval(nothing, h * self.slope.size)

    @cached_property
    def slopes(self) -> Interval:
        """Enclosure of the slopes on the segment."""
        nothing = np.zeros_like(self.value.mid)
        return self.slope + Interval(nothing, 2 * self._half * self.curvature.size)

    def map(self, change: Callable[[Array], Array]) -> Taylor:
        """The same numbers in other places."""
        return Taylor(self.parts.map(lambda x: np.stack([change(part) for part in x])), self.h)

    def __getitem__(self, key: Any) -> Taylor:
        return self.map(lambda x: x[key])

    def taken(self, rows: Any) -> Taylor:
        """The models of some segments."""
        return Taylor(self.parts.map(lambda x: x[:, rows]), self.h[rows])

    @property
    def T(self) -> Taylor:
        """Transposed matrices."""
        return Taylor(self.parts.map(lambda x: x.swapaxes(-1, -2)), self.h)

    def __add__(self, other: Taylor | Array) -> Taylor:
        if isinstance(other, Taylor):
            return Taylor(self.parts + other.parts, self.h)
        return Taylor.of([self.value + other, self.slope, self.curvature], self.h)

    def __neg__(self) -> Taylor:
        return Taylor(-self.parts, self.h)

    def __sub__(self, other: Taylor) -> Taylor:
        return self + -other

    def __mul__(self, other: Any) -> Taylor:
        return self._times(other, mul)

    def __matmul__(self, other: Any) -> Taylor:
        return self._times(other, matmul)

    def __rmatmul__(self, other: Array) -> Taylor:
        return Taylor(other @ self.parts, self.h)

    def _times(self, other: Any, times: Callable[[Any, Any], Interval]) -> Taylor:
        if not isinstance(other, Taylor):
            return Taylor(times(self.parts, other), self.h)
        f, g = self, other
        slope = times(f.value, g.slope) + times(f.slope, g.value)
        bend = times(f.whole, g.curvature) + times(f.slopes, g.slopes) + times(f.curvature, g.whole)
        return Taylor.of([times(f.value, g.value), slope, bend], f.h)


def joined(models: Sequence[Taylor], axis: int) -> Taylor:
    """Models side by side along an axis."""
    mid, rad = (np.concatenate([getattr(x.parts, name) for x in models], axis=axis + 1)
                for name in ("mid", "rad"))  # fmt: skip
    return Taylor(Interval(mid, rad), models[0].h)


def cosines_and_sines(q: Taylor) -> tuple[Taylor, Taylor]:
    """Models of cosines and sines."""
    (c, s), (C, S) = (
        [Interval(f(x.mid), np.minimum(x.rad, 2.0) + 8 * unit(x.mid)) for f in (np.cos, np.sin)]
        for x in (q.value, q.whole)
    )
    half = q.slopes * q.slopes * 0.5
    cosines = [c, -(s * q.slope), -(C * half) - S * q.curvature]
    return Taylor.of(cosines, q.h), Taylor.of([s, c * q.slope, C * q.curvature - S * half], q.h)


def cross(a: Taylor, b: Taylor) -> Taylor:
    """Cross products of columns, (count, 3, k)."""
    after, before = [1, 2, 0], [2, 0, 1]
    return a[:, after] * b[:, before] - a[:, before] * b[:, after]


def inverse_model(N: Taylor) -> tuple[Taylor, Mask]:
    """Models of inverses Y, Y′ = −Y N′Y, Y″/2 = Y N′Y N′Y − Y (N″/2) Y; where they are proved."""
    value, regular = inverse(N.value)
    Y, everywhere = inverse(N.whole)
    for _ in range(2):
        turned = Y @ N.slopes
        bend = turned @ turned @ Y - Y @ N.curvature @ Y
        model = Taylor.of([value, -(value @ N.slope @ value), bend], N.h)
        mid, rad = model.whole.mid, model.whole.rad
        Y = Interval(np.where(rad < Y.rad, mid, Y.mid), np.minimum(rad, Y.rad))
    return model, regular & everywhere
