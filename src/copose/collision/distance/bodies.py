"""Distances and clearance of the solids of a scene in any configuration."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from heapq import heapify, heapreplace

import numpy as np

from copose.collision.carriers import Carrier, Placements
from copose.collision.distance.arm_combinations import ArmCombinations
from copose.collision.distance.clearance_test import ClearanceTest, ClearanceTestOptions
from copose.collision.distance.paired_solids import PairedSolids, PartPoses, PlacedPart
from copose.collision.distance.part_distances import PartDistances
from copose.collision.distance.round_solids import RoundSolids
from copose.collision.shapes.solids import Solid
from copose.poses import Array, Indices, Mask
from copose.robots import Arm


@dataclass(frozen=True)
class Nearest:
    """The two tested solids that are nearest to each other."""

    distance: float  # of the original shapes, m; ≤ 0 where they overlap
    pair: tuple[str, str]  # their names


@dataclass(frozen=True, eq=False)
class Witness:
    """The points at which two shapes are nearest to each other, or overlap deepest."""

    pair: int  # number of the tested pair that they are parts of
    distance: float  # m; where they overlap −(the depth of their hulls)
    first: Carrier  # the carrier of the first shape
    second: Carrier  # the carrier of the other
    a: Array  # the first's point, in its carrier's frame, (3,)
    b: Array  # the other's point, in its carrier's frame, (3,)
    # Unit, in the world, from the first to the other, (3,): moved along with the carriers n·(b − a)
    # is the distance to first order.
    normal: Array


class Bodies(PairedSolids):
    """Solids and the pairs of them that may not touch, with their distances.

    No answer depends on an earlier one; what is kept between queries only saves time. Everything is
    for one thread at a time.

    Attributes:
        clearance: what is kept, m.
    """

    def __init__(
        self,
        solids: Sequence[Solid],
        pairs: Indices,
        arms: Sequence[Arm],
        clearance: float,
        *,
        planar: bool,
        options: ClearanceTestOptions | None = None,
    ) -> None:
        """Find a ball round each solid; pairs of them, (p, 2), are tested against each other."""
        super().__init__(solids, pairs, arms)
        self.clearance = clearance
        self._distances, self._round = PartDistances(clearance), RoundSolids(self)
        self._test = ClearanceTest(
            self,
            self._round,
            self._distances,
            planar=planar,
            options=options or ClearanceTestOptions(),
        )

    # Clearance

    def clear(self, x: Array, pairs: Indices | None = None) -> Mask:
        """True for configurations, (count, size), that keep the clearance in some tested pairs, or
        in all; (count,).
        """
        return self._test.clear(x, self.every if pairs is None else pairs)

    def too_near(self, x: Array, pairs: Indices) -> Mask:
        """True for tested pairs that are too near in one configuration, (size,); (k,)."""
        return self._test.too_near(x, pairs)

    def judge(self, alone: Sequence[Array]) -> Callable[[Indices], tuple[Mask, Mask]]:
        """A fast test of combinations of the arms' postures, configurations by arm, (count_i,
        size), of which only its own joints count, see `ArmCombinations.verdicts`.
        """
        unsure = self._test.options.unsure
        return ArmCombinations(self, self._round, alone, self.clearance, unsure).verdicts

    # Distances

    def hull_distances(self, where: Placements, pairs: Indices, most: float = np.inf) -> Array:
        """Distances of the convex hulls of some pairs, never larger than the bodies'; below zero
        how deep they overlap, m, (k,). What is farther than ``most`` has the bound by balls.
        """
        distances, places = self.bounds(where, pairs), PartPoses(where)
        for k in np.flatnonzero(distances < most):
            distances[k] = self._hull_distance(pairs[k], places)
        return distances

    def distances(self, where: Placements, pairs: Indices) -> Array:
        """Distances of the bodies of some pairs, m, (k,); where they overlap −(the depth of their
        hulls).
        """
        places = PartPoses(where)
        return np.array([self._distance(pair, places) for pair in pairs])

    def nearest(self, x: Array, pairs: Indices | None = None) -> Nearest | None:
        """The nearest of some tested pairs, or of all, in one configuration, (size,); None where
        none is tested.

        What bounds the smallest distance is measured better, balls by hulls and hulls by bodies,
        until it is a distance.
        """
        chosen = self.every if pairs is None else pairs
        where = self.placed(x[None])[0]
        places = PartPoses(where)
        measures = (self._hull_distance, self._distance)
        bounds = zip(self.bounds(where, chosen).tolist(), chosen.tolist(), strict=True)
        known = [(bound, 0, pair) for bound, pair in bounds]
        heapify(known)
        while known:
            least, measured, pair = known[0]
            if measured == len(measures):
                return Nearest(least, self.names(pair))
            heapreplace(known, (measures[measured](pair, places), measured + 1, pair))
        return None

    def overlapping(self, x: Array) -> tuple[str, str] | None:
        """The names of a pair that overlaps in one configuration, (size,), None where none does."""
        where = self.placed(x[None])[0]
        near = self.every[self._round.bounds(where, self.every) <= self._test.options.unsure]
        near = near[self.hull_distances(where, near) <= 0]
        hit = next((k for k in near if self.distances(where, np.array([k]))[0] <= 0), None)
        return None if hit is None else self.names(int(hit))

    def _hull_distance(self, pair: int, places: PartPoses) -> float:
        """Smallest distance of the hulls of two solids' parts, m."""
        return min(self._distances.hull_distance(*both, places) for both in self.parts_of(pair))

    def _distance(self, pair: int, places: PartPoses) -> float:
        """Smallest distance of two solids' parts, m."""
        return min(self._distances.gap(*both, places).distance for both in self.parts_of(pair))

    # Witnesses

    def witnesses(
        self, x: Array, within: float, pairs: Indices | None = None, *, roughly: bool = False
    ) -> list[Witness]:
        """The witnesses of shapes nearer than ``within``, m, in one configuration, (size,).

        Args:
            x: the configuration.
            within: m.
            pairs: of which; all if None.
            roughly: whether hulls stand in for bodies that are a clearance farther apart than that.
        """
        return self.all_witnesses(x[None], within, pairs, roughly=roughly)[0]

    def all_witnesses(
        self, x: Array, within: float, pairs: Indices | None = None, *, roughly: bool = False
    ) -> list[list[Witness]]:
        """The witnesses in each of some configurations, (count, size), see `witnesses`."""
        chosen, where = self.every if pairs is None else pairs, self.placed(x)
        near = self.bounds(where, chosen) < within
        if within <= self.clearance:
            near &= ~self.clear(x, chosen)[:, None]
        return [
            self._witnesses_at(where[k], within, chosen[row], roughly) for k, row in enumerate(near)
        ]

    def _witnesses_at(
        self, where: Placements, within: float, pairs: Indices, roughly: bool
    ) -> list[Witness]:
        """The witnesses of the parts of some pairs that are nearer than a distance, m."""
        places, witnesses, parts = PartPoses(where), list[Witness](), self._distances
        for pair in pairs:
            for one, other in self.parts_of(pair):
                if not parts.hulls_within(one, other, within, places):
                    continue
                far = roughly and not parts.hulls_within(one, other, 2 * self.clearance, places)
                gap = (parts.hull_gap if far else parts.gap)(one, other, places)
                if gap.distance < within:
                    i, j = one.carrier, other.carrier
                    witnesses.append(
                        Witness(
                            pair=int(pair),
                            distance=gap.distance,
                            first=self.carriers[i],
                            second=self.carriers[j],
                            a=where.rotations[i].T @ (gap.a - where.positions[i]),
                            b=where.rotations[j].T @ (gap.b - where.positions[j]),
                            normal=gap.normal,
                        )
                    )
        return witnesses

    # Pairs of parts

    @cached_property
    def parts(self) -> Indices:
        """The tested pair of solids that each tested pair of parts belongs to."""
        return np.array([
            pair for pair in self.every for _ in self.parts_of(pair)
        ], dtype=np.intp)  # fmt: skip

    @cached_property
    def _part_pairs(self) -> list[tuple[PlacedPart, PlacedPart]]:
        """All tested pairs of parts."""
        return [both for pair in self.every for both in self.parts_of(pair)]

    def hull_gap(self, places: PartPoses, k: int) -> tuple[float, Array]:
        """Distance of the hulls of two parts, m, by their number in ``parts``, and its direction,
        (3,).
        """
        gap = self._distances.hull_gap(*self._part_pairs[k], places)
        return gap.distance, gap.normal

    def gap(self, places: PartPoses, k: int) -> float:
        """Distance of two parts themselves, m, by their number in ``parts``."""
        return self._distances.gap(*self._part_pairs[k], places).distance

    def spans(self, where: Placements, k: int, normals: Array) -> Array:
        """Distances of the hulls of two parts along directions, (m, 3), each at its own
        configuration, (m,): no more than those of the parts; m, (m,).
        """
        one, other = self._part_pairs[k]
        reach = np.zeros(len(normals))
        for part, sign in ((one, 1.0), (other, -1.0)):
            R = where.rotations[:, part.carrier]
            own = (sign * normals[:, None] @ R)[:, 0]
            middles = (normals * where.positions[:, part.carrier]).sum(axis=1)
            reach += sign * middles + own @ part.pose.position
            reach += part.shape.support(own @ part.pose.rotation)
        return np.asarray(-reach)
