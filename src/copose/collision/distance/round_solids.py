"""Solids that are a single sphere, disk or capsule: their distance is that of their segments."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from copose.collision.carriers import Placements
from copose.collision.distance.paired_solids import PairedSolids, segments_of
from copose.collision.distance.segments import Segments, segment_distances
from copose.poses import Array, Indices


class RoundSolids:
    """The solids that are all within a radius of a segment.

    Attributes:
        both: which tested pairs are of two such solids, (p,).
    """

    def __init__(self, solids: PairedSolids) -> None:
        """Find the round ones of some solids."""
        self._solids = solids
        single = [
            parts[0] if len(parts) == 1 and parts[0].shape.round else None
            for parts in solids.placed_parts
        ]
        round_ones = np.array([part is not None for part in single], dtype=bool)
        self.both = np.asarray(round_ones[solids.pairs].all(axis=1))
        self._segments = segments_of(single)

    @cached_property
    def radii(self) -> Array:
        """Radii of the two round solids together, of every pair, m, (p,)."""
        radii = np.array([parts[0].shape.hull[1] for parts in self._solids.placed_parts])
        return np.asarray(radii[self._solids.pairs].sum(axis=1))

    def segments(self, where: Placements) -> Segments:
        """Segments of all solids in the world, (..., s, 3); points of those that are not round."""
        return self._segments.moved(where, self._solids.carrier)

    def bounds(self, where: Placements, pairs: Indices) -> Array:
        """Distances of round pairs and of the balls round others in one configuration, m, (k,)."""
        bounds, own = self._solids.bounds(where, pairs), self.both[pairs]
        a, b = self._solids.pairs[pairs[own]].T
        if len(a):
            segments = self.segments(where)
            gaps = segment_distances(segments.of(a), segments.of(b))
            bounds[own] = gaps - self.radii[pairs[own]]
        return bounds

    def distances(self, where: Placements, rows: Indices, pairs: Indices) -> Array:
        """Distances of round pairs, m, (k,), by numbers of configurations and of tested pairs,
        (k,).
        """
        a, b = self._solids.pairs[pairs].T
        segments = self.segments(where)
        gaps = segment_distances(segments.at(rows, a), segments.at(rows, b))
        return np.asarray(gaps - self.radii[pairs])
