"""Minimum-jerk time law from rest to rest: s(x) = 10x³ − 15x⁴ + 6x⁵, x the share of the time."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from copose.poses import Array

Scalars = TypeVar("Scalars", float, Array)


def travelled(x: Scalars) -> Scalars:
    """The share s of the way that is behind, 0 … 1."""
    return x**3 * (10 - 15 * x + 6 * x**2)


def speed(x: Scalars) -> Scalars:
    """ds/dx; at most 15/8, half way."""
    return 30 * x**2 * (1 - x) ** 2


def acceleration(x: Scalars) -> Scalars:
    """d²s/dx²; at most 10/√3 in size, at x = 1/2 ± √3/6."""
    return 60 * x * (1 - x) * (1 - 2 * x)


def extremes() -> Array:
    """Shares of the time at which speed, and the size of acceleration, are largest, (3,)."""
    return np.array([0.5, 0.5 - np.sqrt(3) / 6, 0.5 + np.sqrt(3) / 6])
