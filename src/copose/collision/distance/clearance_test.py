"""Tests of whether solids keep a clearance, by balls, segments, convex hulls and surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from copose.collision.carriers import Placements
from copose.collision.distance.paired_solids import PairedSolids, PartPoses
from copose.collision.distance.part_distances import PartDistances
from copose.collision.distance.round_solids import RoundSolids
from copose.poses import Array, Indices, Mask
from copose.progress import heed

if TYPE_CHECKING:
    from copose.collision.distance.hull_queries import HullQueries


@dataclass(frozen=True)
class ClearanceTestOptions:
    """Choices between ways to test many configurations."""

    few: int = 500  # configurations of a plane that Pinocchio is not loaded for
    block: int = 16  # configurations after which a call may be stopped
    unsure: float = 1e-6  # m, how near to the clearance distances of segments leave it to coal


class ClearanceTest:
    """A test of configurations: whether pairs of solids keep a clearance.

    The bound by balls comes first, then the distance of segments, then hulls, then surfaces.

    Attributes:
        clearance: that is kept, m.
        options: choices between the ways.
    """

    def __init__(
        self,
        solids: PairedSolids,
        round_solids: RoundSolids,
        parts: PartDistances,
        *,
        planar: bool,
        options: ClearanceTestOptions,
    ) -> None:
        """Combine ways to test solids; where they move in a plane only many configurations go to
        Pinocchio.
        """
        self.clearance, self.options = parts.clearance, options
        self._solids, self._round, self._parts = solids, round_solids, parts
        self._planar = planar
        # Pinocchio's models by the pairs that they test.
        self._queries: dict[bytes, HullQueries] = {}

    def clear(self, x: Array, pairs: Indices) -> Mask:
        """True for configurations, (count, size), in which all pairs are clear; (count,)."""
        clear = np.ones(len(x), dtype=np.bool_)
        if not len(pairs) or not len(x):
            return clear
        by_parts, unsure = pairs, np.zeros(len(x), dtype=np.bool_)
        is_round = self._round.both[pairs]
        if is_round.any():
            by_parts = pairs[~is_round]
            hit, unsure = self._round_verdicts(x, pairs[is_round])
            clear[hit] = False
        for left, asked in ((clear & unsure, pairs), (clear & ~unsure, by_parts)):
            if len(asked) and left.any():
                clear[left] = self._clear_by_parts(x[left], asked)
        return clear

    def too_near(self, x: Array, pairs: Indices) -> Mask:
        """True for pairs that are too near in one configuration, (size,); (k,)."""
        where, unsure_by = self._solids.placed(x[None])[0], self.options.unsure
        gaps = self._round.bounds(where, pairs)
        near = gaps < self.clearance + unsure_by
        hit = self._round.both[pairs] & (gaps < self.clearance - unsure_by)
        for k in np.flatnonzero(near & ~hit):
            near[k] = not self._keeps_clear(where, pairs[[k]])
        return np.asarray(near)

    def _round_verdicts(self, x: Array, pairs: Indices) -> tuple[Mask, Mask]:
        """Configurations in which round solids of some pairs are too near, and those that their
        segments leave undecided, (count,) each.
        """
        where, unsure_by = self._solids.placed(x), self.options.unsure
        rows, columns = np.nonzero(self._solids.bounds(where, pairs) < self.clearance)
        gaps = self._round.distances(where, rows, pairs[columns])
        hit, unsure = (np.zeros(len(x), dtype=np.bool_) for _ in range(2))
        hit[rows[gaps < self.clearance - unsure_by]] = True
        unsure[rows[gaps < self.clearance + unsure_by]] = True
        return hit, unsure & ~hit

    def _clear_by_parts(self, x: Array, pairs: Indices) -> Mask:
        """The same as `clear`, by coal."""
        clear = np.ones(len(x), dtype=np.bool_)
        if self._planar and len(x) <= self.options.few:
            where = self._solids.placed(x)
            for k in range(len(x)):
                heed()
                clear[k] = self._keeps_clear(where[k], pairs)
            return clear
        queries, unsure = self._hull_queries(pairs), []
        for k, row in enumerate(x):
            if k % self.options.block == 0:
                heed()
            verdict = queries.verdict(row)
            clear[k] = verdict is not False
            if verdict is None:
                unsure.append(k)
        where = self._solids.placed(x[unsure])
        for j, k in enumerate(unsure):
            clear[k] = not self._enclosing(where[j], pairs)
        return clear

    def _hull_queries(self, pairs: Indices) -> HullQueries:
        """Pinocchio's queries of the parts of some pairs, built once."""
        # Pinocchio takes a quarter of a second to load, which small questions need not wait for.
        from copose.collision.distance.hull_queries import HullQueries

        key, solids = pairs.tobytes(), self._solids
        if key not in self._queries:
            parts = [part for parts in solids.placed_parts for part in parts]
            first = np.cumsum([0, *(len(parts) for parts in solids.placed_parts)])
            between = [
                (first[a] + i, first[b] + j)
                for a, b in solids.pairs[pairs]
                for i in range(len(solids.placed_parts[a]))
                for j in range(len(solids.placed_parts[b]))
            ]
            self._queries[key] = HullQueries(
                solids.arms,
                [(part.shape, part.pose, solids.carriers[part.carrier]) for part in parts],
                np.array(between),
                self.clearance,
            )
        return self._queries[key]

    def _keeps_clear(self, where: Placements, pairs: Indices) -> bool:
        """True where the solids of some pairs keep the clearance, those with the nearest hulls
        tested first.
        """
        places, left = PartPoses(where), []
        for pair in pairs[self._solids.bounds(where, pairs) < self.clearance]:
            for one, other in self._solids.parts_of(pair):
                gap = self._parts.hull_distance(one, other, places)
                if gap >= self.clearance:
                    continue
                if gap < self.clearance - one.shape.below - other.shape.below:
                    return False
                left.append((gap, one, other))
        left.sort(key=lambda entry: entry[0])
        return all(self._parts.keep_clear(one, other, gap, places) for gap, one, other in left)

    def _enclosing(self, where: Placements, pairs: Indices) -> bool:
        """True where a body encloses the other in any of some pairs, whose surfaces are apart."""
        places = PartPoses(where)
        return any(
            self._parts.enclosed(one, other, places)
            for pair in pairs[self._solids.bounds(where, pairs) <= 0]
            for one, other in self._solids.parts_of(pair)
            if (one.shape.hollow or other.shape.hollow)
            and self._parts.hulls_within(one, other, 0.0, places)
        )
