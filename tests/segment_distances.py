"""Distances of segments in plain numpy."""

from __future__ import annotations

import numpy as np

Array = np.ndarray


def segment_distances(a0: Array, a1: Array, b0: Array, b1: Array) -> Array:
    """Min over s, t in [0, 1] of ‖a0 + s (a1 − a0) − b0 − t (b1 − b0)‖, row by row.

    The least of five: an end of one segment is nearest to the other, or inner points of both are,
    and then those of their lines.

    Args:
        a0: one end of the first segments, shape (k, 3); ``a1`` the other.
        a1: see ``a0``.
        b0: one end of the second segments, shape (k, 3); ``b1`` the other.
        b1: see ``b0``.
    """
    ends = [_from_point(a0, b0, b1), _from_point(a1, b0, b1), _from_point(b0, a0, a1),
            _from_point(b1, a0, a1)]  # fmt: skip
    u, v, w = a1 - a0, b1 - b0, b0 - a0
    normal = np.cross(u, v)
    square = _dot(normal, normal)
    safe = np.where(square > 0, square, 1.0)
    s, t = _dot(np.cross(w, v), normal) / safe, _dot(np.cross(w, u), normal) / safe
    inner = (square > 0) & (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    lines = np.where(inner, np.abs(_dot(w, normal)) / np.sqrt(safe), np.inf)
    return np.min([*ends, lines], axis=0)


def _from_point(p: Array, a: Array, b: Array) -> Array:
    """Distances of points from segments."""
    along = b - a
    square = _dot(along, along)
    t = np.clip(_dot(p - a, along) / np.where(square > 0, square, 1.0), 0.0, 1.0)
    return np.linalg.norm(p - a - t[:, None] * along, axis=1)


def _dot(a: Array, b: Array) -> Array:
    return np.einsum("ij,ij->i", a, b)
