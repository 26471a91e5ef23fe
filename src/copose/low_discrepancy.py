"""Points that fill the unit cube evenly: the R-sequence, an additive recurrence (Roberts, 2018)."""

from __future__ import annotations

import numpy as np

from copose.poses import Array


def points(count: int, dimension: int, rng: np.random.Generator) -> Array:
    """The points frac(s + n α) of [0, 1)ᵈ, n = 0, 1, …, with the shift s drawn: (count, dimension).

    α_k = g⁻ᵏ, where g is the positive root of gᵈ⁺¹ = g + 1: the golden ratio for d = 1.
    """
    root = 1.5
    # The fixed point contracts by 1/(d + 1) at least.
    for _ in range(60):
        root = (1 + root) ** (1 / (dimension + 1))
    steps = root ** -np.arange(1.0, dimension + 1)
    return np.mod(rng.random(dimension) + np.arange(count)[:, None] * steps, 1.0)
