"""Distances of segments in plain numpy."""

from __future__ import annotations

import numpy as np

Array = np.ndarray

# Below this share of |u|²|v|² the square of u × v is rounding: the segments count as parallel, at
# most 3e-8 of their length wrong.
_PARALLEL = 1e-15
_TINY = np.finfo(float).tiny


def segment_distances(a0: Array, a1: Array, b0: Array, b1: Array) -> Array:
    """Min over s, t in [0, 1] of ‖a0 + s (a1 − a0) − b0 − t (b1 − b0)‖, row by row.

    Exact for parallel segments and for those that are points.

    Args:
        a0: one end of the first segments, shape (k, 3); ``a1`` the other.
        a1: see ``a0``.
        b0: one end of the second segments, shape (k, 3); ``b1`` the other.
        b1: see ``b0``.
    """
    u, v, w = a1 - a0, b1 - b0, a0 - b0
    uu, vv, uv = _dot(u, u), _dot(v, v), _dot(u, v)
    uw, vw = _dot(u, w), _dot(v, w)
    # The lines' own nearest point on a, then the nearest on b to that, then on a to that: the
    # third step undoes what clipping spoils, for the square distance is convex in (s, t).
    across = uu * vv - uv * uv
    crossing = across > _PARALLEL * uu * vv
    s = np.where(crossing, uv * vw - vv * uw, 0.0) / np.where(crossing, across, 1.0)
    s = np.clip(s, 0.0, 1.0)
    t = np.clip((uv * s + vw) / np.maximum(vv, _TINY), 0.0, 1.0)
    s = np.clip((uv * t - uw) / np.maximum(uu, _TINY), 0.0, 1.0)
    between = w + s[:, None] * u - t[:, None] * v
    distances: Array = np.sqrt(_dot(between, between))
    return distances


def _dot(a: Array, b: Array) -> Array:
    product: Array = np.einsum("ij,ij->i", a, b)
    return product
