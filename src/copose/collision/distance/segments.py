"""Segments and their distances, which are those of spheres, disks and capsules less their radii."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from copose.collision.carriers import Placements
from copose.poses import Array, Indices


class Segments(NamedTuple):
    """Segments by one end of each and the vector from there to the other end."""

    begin: Array  # one end, m, (..., 3)
    along: Array  # from there to the other end, m, (..., 3)

    def of(self, which: Indices) -> Segments:
        """Segments, some of every configuration, (..., k, 3)."""
        return Segments(self.begin[..., which, :], self.along[..., which, :])

    def at(self, rows: Indices, which: Indices) -> Segments:
        """Segments, one of each of some configurations, (k, 3)."""
        return Segments(self.begin[rows, which], self.along[rows, which])

    def moved(self, where: Placements, carrier: Indices) -> Segments:
        """Segments in the world, (..., s, 3), of those (s, 3) in the frames of their carriers."""
        R = where.rotations[..., carrier, :, :]
        begin, along = (np.einsum("...sij,sj->...si", R, vectors) for vectors in self)
        return Segments(begin + where.positions[..., carrier, :], along)


def segment_distances(one: Segments, other: Segments, parallel: float = 1e-15) -> Array:
    """Distances of segments, min ‖a + s u − b − t v‖ over s and t from 0 to 1, row by row, m, (k,).

    Args:
        one: a and u, (k, 3) each.
        other: b and v, (k, 3) each.
        parallel: the share of what it may be, up to which the squared cross product of two
            directions counts as zero; the distance is then too large by less than 1e-7 of a length.
    """
    tiny = float(np.finfo(float).tiny)
    u, v, w = one.along, other.along, one.begin - other.begin
    uu, vv, uv, uw, vw = (_dot(*both) for both in ((u, u), (v, v), (u, v), (u, w), (v, w)))
    across = uu * vv - uv * uv
    crossing = across > parallel * uu * vv
    s = np.where(crossing, uv * vw - vv * uw, 0.0) / np.where(crossing, across, 1.0)
    # From the nearest point of the lines to the nearest of the other segment, and back: the square
    # of the distance is convex, so that the second step corrects what clipping in the first did.
    s = np.clip(s, 0.0, 1.0)
    t = np.clip((uv * s + vw) / np.maximum(vv, tiny), 0.0, 1.0)
    s = np.clip((uv * t - uw) / np.maximum(uu, tiny), 0.0, 1.0)
    between = w + s[:, None] * u - t[:, None] * v
    return np.asarray(np.sqrt(_dot(between, between)))


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.einsum("ij,ij->i", a, b))
