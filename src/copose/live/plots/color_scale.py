"""Colours for values, from low to high."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from copose.poses import Array

VIRIDIS = (
    "440154", "482878", "3e4989", "31688e", "26828e", "1f9e89", "35b779", "6ece58", "b5de2b",
    "fde725",
)  # fmt: skip
"""Matplotlib's viridis from low to high at equal distances."""


def color_table(colors: tuple[str, ...] = VIRIDIS) -> Array:
    """256 colours from low to high, (256, 3), 0 to 255."""
    anchors = np.array([[int(c[k : k + 2], 16) for k in (0, 2, 4)] for c in colors])
    at = np.linspace(0, len(anchors) - 1, 256)
    return np.column_stack([np.interp(at, np.arange(len(anchors)), column) for column in anchors.T])


@dataclass(frozen=True)
class ColorScale:
    """The colours of values between two; beyond them those of the ends.

    Attributes:
        low: value of the lowest colour.
        high: of the highest.
    """

    low: float
    high: float

    @classmethod
    def of(cls, values: Array, fallen: float = 0.02) -> ColorScale:
        """The scale of some values; of a part of them, which fall far near singularities, the
        colour is the lowest. Those that are not finite do not count.
        """
        values = values[np.isfinite(values)]
        if not len(values):
            return cls(0.0, 1.0)
        return cls(float(np.quantile(values, fallen, method="lower")), float(values.max()))

    @cached_property
    def _table(self) -> Array:
        return color_table()

    def colors(self, values: Array) -> np.ndarray:
        """Red, green and blue of values, (count, 3) of uint8."""
        width = self.high - self.low
        part = (values - self.low) / width if width > 0 else np.ones(len(values))
        indices = (np.clip(part, 0.0, 1.0) * 255).astype(np.intp)
        return self._table[indices].round().astype(np.uint8)
