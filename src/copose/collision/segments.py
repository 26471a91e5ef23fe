"""Spheres, disks and capsules: how near they come is how near their segments do."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from copose.collision.carriers import Placements
from copose.poses import Array, Indices

# Segments whose directions' cross product, squared, is no more than such a share of what it may be
# count as parallel: their distance is too large by less than 1e-7 of their length.
_PARALLEL = 1e-15
_TINY = float(np.finfo(float).tiny)
# Round bodies whose distance is nearer to the clearance than so much, m, are coal's to judge.
UNSURE = 1e-6


class Segments(NamedTuple):
    """Segments by a point of each and where they go from there.

    Attributes:
        begin: one end, (..., 3).
        along: from there to the other end, alike.
    """

    begin: Array
    along: Array

    def of(self, which: Indices) -> Segments:
        """Segments, some of every configuration, (..., k, 3)."""
        return Segments(self.begin[..., which, :], self.along[..., which, :])

    def at(self, rows: Indices, which: Indices) -> Segments:
        """Segments, one of each of some configurations, (k, 3)."""
        return Segments(self.begin[rows, which], self.along[rows, which])

    def moved(self, where: Placements, carrier: Indices) -> Segments:
        """Segments in the world, (..., s, 3), of those (s, 3) in the frames of their carriers."""
        R = where.rotations[..., carrier, :, :]
        begin, along = (np.einsum("...sij,sj->...si", R, each) for each in self)
        return Segments(begin + where.positions[..., carrier, :], along)


def segment_distances(one: Segments, other: Segments) -> Array:
    """Min ‖a + s u − b − t v‖ over s and t from 0 to 1, row by row, (k,)."""
    u, v, w = one.along, other.along, one.begin - other.begin
    uu, vv, uv, uw, vw = (_dot(*both) for both in ((u, u), (v, v), (u, v), (u, w), (v, w)))
    across = uu * vv - uv * uv
    crossing = across > _PARALLEL * uu * vv
    s = np.where(crossing, uv * vw - vv * uw, 0.0) / np.where(crossing, across, 1.0)
    # From the nearest point of the lines to the other segment's nearest, and back: the square of
    # the distance is convex, and what clipping one spoils the other mends.
    s = np.clip(s, 0.0, 1.0)
    t = np.clip((uv * s + vw) / np.maximum(vv, _TINY), 0.0, 1.0)
    s = np.clip((uv * t - uw) / np.maximum(uu, _TINY), 0.0, 1.0)
    between = w + s[:, None] * u - t[:, None] * v
    return np.asarray(np.sqrt(_dot(between, between)))


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.einsum("ij,ij->i", a, b))
