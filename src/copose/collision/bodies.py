"""How near bodies come: bounds by convex hulls, and where these say nothing the bodies, by coal."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from heapq import heapify, heapreplace
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from copose.collision.carriers import (
    Carrier,
    Placements,
    carrier_poses,
    carriers_of,
)
from copose.collision.segments import UNSURE, Segments, segment_distances
from copose.collision.solids import Mesh, Part, Solid
from copose.collision.two_arms import TwoArms
from copose.poses import Array, Indices, Mask, Pose
from copose.progress import heed
from copose.robots import Arm

if TYPE_CHECKING:
    from copose.collision.hull_queries import HullQueries

# How exactly distances are computed, relative, and where that does not converge; what is no depth,
# m; below what distance, m, their normal is the hulls'.
TOLERANCES, _ABSURD, _TOUCHING = (1e-10, 1e-6, 1e-4), 1e6, 1e-9
# Configurations of a plane that Pinocchio is not asked for.
_FEW = 500
# By what share squares of distances of balls may be rounded.
_CAUTION = 1e-9
# After how many configurations a call may have to end.
_HEEDED = 16


@dataclass(frozen=True)
class Nearest:
    """The two tested solids that are nearest to each other.

    Attributes:
        distance: of the original shapes, m; ≤ 0 where they overlap.
        pair: their names.
    """

    distance: float
    pair: tuple[str, str]


@dataclass(frozen=True, eq=False)
class Witness:
    """Where two shapes are nearest to each other, or overlap deepest.

    Attributes:
        pair: number of the tested pair that they are parts of.
        distance: m; where they overlap −(the depth of their hulls).
        first: the carrier of the first; ``second`` of the other.
        a: the first's point, in its carrier's frame, (3,).
        b: the other's, alike.
        normal: unit, in the world, from the first to the other, (3,): moved along with the carriers
            n·(b − a) is the distance to first order.
    """

    pair: int
    distance: float
    first: Carrier
    second: Carrier
    a: Array
    b: Array
    normal: Array


@dataclass(frozen=True, eq=False)
class _Placed:
    """A part of a solid, in the frame of the solid's carrier."""

    part: Part
    pose: Pose
    carrier: int

    def at(self, where: Placements) -> tuple[Array, Array]:
        """Rotation and position in the world."""
        R = where.rotations[self.carrier]
        return R @ self.pose.rotation, R @ self.pose.position + where.positions[self.carrier]


class Bodies:
    """Solids and the pairs of them that may not touch, in any configuration.

    Configurations are rows as `configurations` makes them. Everything is for one thread at a time.

    Attributes:
        solids: as in the scene.
        pairs: the two solids of each tested pair, (p, 2).
        carriers: in the order of `Placements`.
        clearance: what is kept, m.
        centres: of a ball round every solid, in its carrier's frame, (s, 3).
        radii: of these, (s,).
        carrier: number of each solid's carrier, (s,).
    """

    def __init__(
        self, solids: Sequence[Solid], pairs: Indices, arms: Sequence[Arm], clearance: float,
        *, planar: bool,
    ) -> None:  # fmt: skip
        """Find a ball round each solid.

        Args:
            solids: all.
            pairs: numbers of those that are tested against each other, (p, 2).
            arms: that carry them.
            clearance: m.
            planar: whether they move in a plane; Pinocchio is asked of many configurations alone.
        """
        self.solids, self.pairs, self.clearance = tuple(solids), pairs, clearance
        self.carriers = carriers_of(arms)
        self._arms = tuple(arms)
        number = {carrier: i for i, carrier in enumerate(self.carriers)}
        self.carrier = np.array([number[solid.carrier] for solid in solids], dtype=np.intp)
        self._parts = [
            [_Placed(part, solid.placement @ part.placement, number[solid.carrier])
             for part in solid.parts]
            for solid in solids
        ]  # fmt: skip
        balls = [_ball(parts) for parts in self._parts]
        self.centres = np.reshape([centre for centre, _ in balls], (-1, 3))
        self.radii = np.array([radius for _, radius in balls])
        moved = np.array([s.carrier.arm if s.carrier.kind == "joint" else -1 for s in solids], int)
        self._pair_arms = moved[pairs]
        self._planar = planar
        alone = [parts[0] if len(parts) == 1 and parts[0].part.shape.round else None
                 for parts in self._parts]  # fmt: skip
        known = np.array([part is not None for part in alone], dtype=bool)
        self._round = np.asarray(known[pairs].all(axis=1))
        self._segments = _segments(alone)
        self._queries: dict[bytes, HullQueries] = {}
        self._tests: dict[tuple[int, int], tuple[Any, Any]] = {}
        # The same configuration is often asked for several times on end.
        self._latest: tuple[bytes, Placements] | None = None

    # Which pairs

    def own(self, i: int) -> Indices:
        """Tested pairs that only arm i moves against each other, or against what stands still."""
        mine = (self._pair_arms == i) | (self._pair_arms == -1)
        return np.flatnonzero(mine.all(axis=1) & (self._pair_arms == i).any(axis=1))

    @cached_property
    def shared(self) -> Indices:
        """Tested pairs of solids of two arms."""
        return np.flatnonzero(
            (self._pair_arms >= 0).all(axis=1) & (self._pair_arms[:, 0] != self._pair_arms[:, 1])
        )

    @cached_property
    def still(self) -> Indices:
        """Tested pairs that no joint moves."""
        return np.flatnonzero((self._pair_arms < 0).all(axis=1))

    @cached_property
    def every(self) -> Indices:
        """All tested pairs."""
        return np.arange(len(self.pairs))

    def names(self, pair: int) -> tuple[str, str]:
        """Of the solids of a tested pair."""
        a, b = self.pairs[pair]
        return self.solids[a].name, self.solids[b].name

    # What is asked

    def placed(self, x: Array) -> Placements:
        """Where all carriers are in configurations, (count, size)."""
        key = x.tobytes()
        if self._latest is None or self._latest[0] != key:
            self._latest = key, carrier_poses(self._arms, x)
        return self._latest[1]

    def clear(self, x: Array, pairs: Indices | None = None) -> Mask:
        """Which configurations, (count, size), keep the clearance in some tested pairs, or in all;
        (count,).
        """
        some = self.every if pairs is None else pairs
        clear = np.ones(len(x), dtype=np.bool_)
        if not len(some) or not len(x):
            return clear
        others, unsure = some, np.zeros(len(x), dtype=np.bool_)
        if self._round[some].any():
            mine, others = some[self._round[some]], some[~self._round[some]]
            where, (a, b) = self.placed(x), self.pairs[mine].T
            rows, columns = np.nonzero(self.bounds(where, mine) < self.clearance)
            segments = self._segments.moved(where, self.carrier)
            gaps = segment_distances(segments.at(rows, a[columns]), segments.at(rows, b[columns]))
            hit, unsure = self._judged(len(x), rows, gaps - self._thick[mine[columns]])
            clear[hit] = False
        for left, asked in ((clear & unsure, some), (clear & ~unsure, others)):
            if len(asked) and left.any():
                clear[left] = self._asked(x[left], asked)
        return clear

    def _asked(self, x: Array, pairs: Indices) -> Mask:
        """The same, by coal."""
        clear = np.ones(len(x), dtype=np.bool_)
        if self._planar and len(x) <= _FEW:
            where = self.placed(x)
            for k in range(len(x)):
                heed()
                clear[k] = self._keeps_clear(where[k], pairs)
            return clear
        queries, unsure = self._hulls(pairs), []
        for k, row in enumerate(x):
            if k % _HEEDED == 0:
                heed()
            verdict = queries.verdict(row)
            clear[k] = verdict is not False
            if verdict is None:
                unsure.append(k)
        where = self.placed(x[unsure])
        for j, k in enumerate(unsure):
            clear[k] = not self._enclosing(where[j], pairs)
        return clear

    @cached_property
    def _thick(self) -> Array:
        """Radii of two round bodies together, of every pair, m, (p,)."""
        radii = np.array([parts[0].part.shape.hull[1] for parts in self._parts])
        return np.asarray(radii[self.pairs].sum(axis=1))

    def _judged(self, count: int, rows: Indices, gaps: Array) -> tuple[Mask, Mask]:
        """Configurations, of so many, with round bodies too near, and those that are undecided.

        Args:
            count: how many there are.
            rows: the configuration that each distance belongs to, (k,).
            gaps: distances of round bodies, m, (k,).
        """
        hit, unsure = (np.zeros(count, dtype=np.bool_) for _ in range(2))
        hit[rows[gaps < self.clearance - UNSURE]] = True
        unsure[rows[gaps < self.clearance + UNSURE]] = True
        return hit, unsure & ~hit

    def too_near(self, x: Array, pairs: Indices) -> Mask:
        """Which of some tested pairs are too near in a configuration, (size,); (k,)."""
        where = self.placed(x[None])[0]
        near = self.bounds(where, pairs) < self.clearance
        for k in np.flatnonzero(near):
            near[k] = not self._keeps_clear(where, pairs[[k]])
        return np.asarray(near)

    def bounds(self, where: Placements, pairs: Indices) -> Array:
        """Distances of one ball round each solid of some pairs, (..., k)."""
        centres = self._centred(where)
        a, b = self.pairs[pairs].T
        gaps = np.linalg.norm(centres[..., a, :] - centres[..., b, :], axis=-1)
        bounds: Array = gaps - self.radii[a] - self.radii[b]
        return bounds

    def judge(self, alone: Sequence[Array]) -> Callable[[Indices], tuple[Mask, Mask]]:
        """A test of combinations of the arms: whether balls round their solids, or they themselves
        where they are round, lie apart.

        Args:
            alone: by arm, configurations, (count_i, size), of which only its own joints count.

        Returns:
            A function of numbers of these, (count, K): which are clear, and which are not, (count,)
            each; what neither holds of is undecided.
        """
        arms, tables = self._pair_arms[self.shared], list[TwoArms]()
        where = [self.placed(x) for x in alone]
        centres = [self._centred(each) for each in where]
        segments = [self._segments.moved(each, self.carrier) for each in where]
        for i, j in combinations(range(len(alone)), 2):
            forth, back = (self.shared[(arms == both).all(axis=1)] for both in ([i, j], [j, i]))
            pairs = np.concatenate([forth, back])
            a, b = np.vstack([self.pairs[forth], self.pairs[back][:, ::-1]]).T
            least = self.radii[a] + self.radii[b] + self.clearance
            # Most never come near: the boxes round all places of their balls are apart.
            low, high = (
                np.array([f(centres[k], axis=0) for k in (i, j)]) for f in (np.min, np.max)
            )
            between = np.maximum(low[0, a] - high[1, b], low[1, b] - high[0, a])
            some = np.linalg.norm(np.maximum(between, 0.0), axis=1) < least * (1 + _CAUTION)
            a, b, pairs = a[some], b[some], pairs[some]
            squares = least[some] ** 2 * (1 + _CAUTION)
            tables.append(TwoArms(
                i, j, centres[i][:, a], centres[j][:, b], squares, segments[i].of(a),
                segments[j].of(b), self._round[pairs], self._thick[pairs] + self.clearance,
            ))  # fmt: skip

        def judged(chosen: Indices) -> tuple[Mask, Mask]:
            unsure, hit = (np.zeros(len(chosen), dtype=np.bool_) for _ in range(2))
            for table in tables:
                both = table.judged(chosen)
                unsure |= both[0]
                hit |= both[1]
            return ~(unsure | hit), hit

        return judged

    def _centred(self, where: Placements) -> Array:
        """Centres of the balls round all solids, (..., s, 3)."""
        i = self.carrier
        centres = np.einsum("...sij,sj->...si", where.rotations[..., i, :, :], self.centres)
        return np.asarray(centres + where.positions[..., i, :])

    def hull_distances(self, where: Placements, pairs: Indices, most: float = np.inf) -> Array:
        """Distances of the convex hulls of some pairs, never larger than the bodies'; below zero
        how deep they overlap, (k,). What is farther than ``most`` has the bound by balls.
        """
        found, places = self.bounds(where, pairs), Places(where)
        for k in np.flatnonzero(found < most):
            found[k] = min(self._hull(one, other, places) for one, other in self._of(pairs[k]))
        return found

    def distances(self, where: Placements, pairs: Indices) -> Array:
        """Of the bodies of some pairs, m, (k,); where they overlap −(the depth of their hulls)."""
        places = Places(where)
        return np.array([
            min(self._exact(one, other, places)[0] for one, other in self._of(pair))
            for pair in pairs
        ])  # fmt: skip

    def nearest(self, x: Array, pairs: Indices | None = None) -> Nearest | None:
        """The nearest of some tested pairs, or of all, in a configuration, (size,); None where
        none is tested.

        What bounds the smallest distance is measured better, balls by hulls and hulls by bodies,
        until it is a distance.
        """
        some = self.every if pairs is None else pairs
        where = self.placed(x[None])[0]
        places = Places(where)
        measures = (self._hull, lambda *both: self._exact(*both)[0])
        known = [(bound, 0, pair) for bound, pair in
                 zip(self.bounds(where, some).tolist(), some.tolist(), strict=True)]  # fmt: skip
        heapify(known)
        while known:
            least, measured, pair = known[0]
            if measured == len(measures):
                return Nearest(least, self.names(pair))
            better = min(measures[measured](*both, places) for both in self._of(pair))
            heapreplace(known, (better, measured + 1, pair))
        return None

    def witnesses(
        self, x: Array, within: float, pairs: Indices | None = None, *, roughly: bool = False
    ) -> list[Witness]:
        """The witnesses of shapes nearer than ``within``, m, in a configuration, (size,).

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
        """The same in each of some configurations, (count, size)."""
        some, where = self.every if pairs is None else pairs, self.placed(x)
        near = self.bounds(where, some) < within
        if within <= self.clearance:
            near &= ~self.clear(x, some)[:, None]
        return [self._near(where[k], within, some[mine], roughly) for k, mine in enumerate(near)]

    def _near(
        self, where: Placements, within: float, pairs: Indices, roughly: bool
    ) -> list[Witness]:
        places, found = Places(where), []
        for pair in pairs:
            for one, other in self._of(pair):
                if not self._within(one, other, within, places):
                    continue
                far = roughly and not self._within(one, other, 2 * self.clearance, places)
                distance, a, b, normal = self._exact(one, other, places, hulls=far)
                if distance < within:
                    i, j = one.carrier, other.carrier
                    found.append(Witness(
                        int(pair), distance, self.carriers[i], self.carriers[j],
                        where.rotations[i].T @ (a - where.positions[i]),
                        where.rotations[j].T @ (b - where.positions[j]),
                        normal,
                    ))  # fmt: skip
        return found

    def overlapping(self, x: Array) -> tuple[str, str] | None:
        """The names of a pair that overlaps in a configuration, (size,), None where none does."""
        where = self.placed(x[None])[0]
        near = self.every[self.bounds(where, self.every) <= 0]
        near = near[self.hull_distances(where, near) <= 0]
        hit = next((k for k in near if self.distances(where, np.array([k]))[0] <= 0), None)
        return None if hit is None else self.names(int(hit))

    # How it is answered

    def _hulls(self, pairs: Indices) -> HullQueries:
        # Pinocchio takes a quarter of a second to load, which small questions need not wait for.
        from copose.collision.hull_queries import HullQueries

        key = pairs.tobytes()
        if key not in self._queries:
            parts = [part for parts in self._parts for part in parts]
            first = np.cumsum([0, *(len(parts) for parts in self._parts)])
            between = [
                (first[a] + i, first[b] + j)
                for a, b in self.pairs[pairs]
                for i in range(len(self._parts[a]))
                for j in range(len(self._parts[b]))
            ]
            self._queries[key] = HullQueries(
                self._arms,
                [(part.part.shape, part.pose, self.carriers[part.carrier]) for part in parts],
                np.array(between),
                self.clearance,
            )
        return self._queries[key]

    def _keeps_clear(self, where: Placements, pairs: Indices) -> bool:
        """Whether bodies of some pairs keep the clearance, those whose hulls are nearest first."""
        places, left = Places(where), []
        for pair in pairs[self.bounds(where, pairs) < self.clearance]:
            for one, other in self._of(pair):
                gap = self._hull(one, other, places)
                if gap >= self.clearance:
                    continue
                if gap < self.clearance - one.part.shape.below - other.part.shape.below:
                    return False
                left.append((gap, one, other))
        left.sort(key=lambda each: each[0])
        return all(self._apart(one, other, gap, places) for gap, one, other in left)

    def _enclosing(self, where: Placements, pairs: Indices) -> bool:
        """True where a body encloses the other in any of some pairs, whose surfaces are apart."""
        places = Places(where)
        return any(
            self._encloses(one, other, places)
            for pair in pairs[self.bounds(where, pairs) <= 0]
            for one, other in self._of(pair)
            if (isinstance(one.part.shape, Mesh) or isinstance(other.part.shape, Mesh))
            and self._within(one, other, 0.0, places)
        )

    def _apart(self, one: _Placed, other: _Placed, gap: float, places: Places) -> bool:
        """Whether two parts keep the clearance whose hulls do not."""
        import coal

        functor, result = self._functor(one, other, "collide"), coal.CollisionResult()
        hit = functor(places(one), places(other), self._margin, result) > 0
        return not hit and not (gap <= 0 and self._encloses(one, other, places))

    def _of(self, pair: int) -> Iterator[tuple[_Placed, _Placed]]:
        """The parts of a pair of solids, each of one with each of the other."""
        a, b = self.pairs[pair]
        return ((one, other) for one in self._parts[a] for other in self._parts[b])

    # Part by part

    @cached_property
    def parts(self) -> Indices:
        """The tested pair that each two parts belong to, that are tested against each other."""
        return np.array([
            pair for pair in self.every for _ in self._of(pair)
        ], dtype=np.intp)  # fmt: skip

    @cached_property
    def _two(self) -> list[tuple[_Placed, _Placed]]:
        return [both for pair in self.every for both in self._of(pair)]

    def hull_gap(self, places: Places, k: int) -> tuple[float, Array]:
        """Distance of the hulls of two parts, by their number in ``parts``, and its direction."""
        distance, result = self._measured(*self._two[k], "hulls", places)
        return distance, result.normal

    def gap(self, places: Places, k: int) -> float:
        """Distance of two parts themselves."""
        return self._exact(*self._two[k], places)[0]

    def spans(self, where: Placements, k: int, normals: Array) -> Array:
        """Distances of the hulls of two parts along directions, (m, 3), each at its own
        configuration, (m,): no more than those of the parts; (m,).
        """
        one, other = self._two[k]
        reach = np.zeros(len(normals))
        for part, sign in ((one, 1.0), (other, -1.0)):
            R = where.rotations[:, part.carrier]
            own = (sign * normals[:, None] @ R)[:, 0]
            middles = (normals * where.positions[:, part.carrier]).sum(axis=1)
            reach += sign * middles + own @ part.pose.position
            reach += part.part.shape.support(own @ part.pose.rotation)
        return np.asarray(-reach)

    def _functor(self, one: _Placed, other: _Placed, what: str) -> Any:
        """A functor of coal for two parts: their distance, their hulls', or a test of nearness.

        New each time: what it was asked before changes its last digits.
        """
        import coal

        shapes = [p.part.shape.bound if what.startswith("hulls") else p.part.shape.coal
                  for p in (one, other)]  # fmt: skip
        make = coal.ComputeCollision if what.endswith("collide") else coal.ComputeDistance
        return make(*shapes)

    def _hull(self, one: _Placed, other: _Placed, places: Places) -> float:
        """Distance of the hulls of two parts."""
        return self._measured(one, other, "hulls", places)[0]

    def _within(self, one: _Placed, other: _Placed, most: float, places: Places) -> bool:
        """True where the hulls of two parts are nearer than so much, m, to the last digits."""
        import coal

        # The last digits of the answer do not matter: functors may be asked again.
        key = id(one), id(other)
        if key not in self._tests:
            request = coal.CollisionRequest()
            request.enable_contact = False
            request.gjk_initial_guess = coal.GJKInitialGuess.DefaultGuess
            self._tests[key] = self._functor(one, other, "hulls collide"), request
        functor, request = self._tests[key]
        request.security_margin = most + TOLERANCES[1]
        return bool(functor(places(one), places(other), request, coal.CollisionResult()) > 0)

    def _measured(
        self, one: _Placed, other: _Placed, what: str, places: Places
    ) -> tuple[float, Any]:
        import coal

        functor = self._functor(one, other, what)
        for request in self._requests:
            result = coal.DistanceResult()
            distance = functor(places(one), places(other), request, result)
            # The depth of round bodies may not converge so far.
            if distance > -_ABSURD:
                break
        return distance, result

    @cached_property
    def _requests(self) -> list[Any]:
        """What distances are asked with, in order, until one converges."""
        import coal

        requests = []
        for tolerance in TOLERANCES:
            request = coal.DistanceRequest()
            request.gjk_tolerance = request.epa_tolerance = tolerance
            request.enable_signed_distance = True
            requests.append(request)
        return requests

    @cached_property
    def _margin(self) -> Any:
        import coal

        request = coal.CollisionRequest()
        request.security_margin, request.enable_contact = self.clearance, False
        request.gjk_tolerance = request.epa_tolerance = TOLERANCES[0]
        return request

    def _exact(
        self, one: _Placed, other: _Placed, places: Places, *, hulls: bool = False
    ) -> tuple[float, Array, Array, Array]:
        """Distance of two parts, the point of each, and the normal.

        For coal a mesh is its surface, and where two cross it tells no depth: hulls do.
        """
        meshes = isinstance(one.part.shape, Mesh) or isinstance(other.part.shape, Mesh)
        if meshes and not hulls:
            distance, result = self._measured(one, other, "bodies", places)
            if distance > _TOUCHING and not self._encloses(one, other, places):
                a, b = result.getNearestPoint1(), result.getNearestPoint2()
                return distance, a, b, (b - a) / np.linalg.norm(b - a)
            distance, result = self._measured(one, other, "hulls", places)
            distance = min(distance, 0.0)
        else:
            distance, result = self._measured(one, other, "hulls", places)
        return distance, result.getNearestPoint1(), result.getNearestPoint2(), result.normal

    def _encloses(self, one: _Placed, other: _Placed, places: Places) -> bool:
        """Whether a mesh of one of two parts that do not cross encloses the other."""
        for outer, inner in ((one, other), (other, one)):
            shape = outer.part.shape
            if isinstance(shape, Mesh):
                (R, p), (S, q) = outer.at(places.where), inner.at(places.where)
                if shape.encloses(R.T @ (S @ inner.part.shape.witness + q - p)):
                    return True
        return False


class Places:
    """The placements of parts in a configuration, as coal takes them."""

    def __init__(self, where: Placements) -> None:
        """Nothing placed yet."""
        self.where = where
        self._known: dict[int, Any] = {}

    def __call__(self, part: _Placed) -> Any:
        """The placement of a part."""
        import coal

        if id(part) not in self._known:
            self._known[id(part)] = coal.Transform3s(*part.at(self.where))
        return self._known[id(part)]


def _segments(parts: Sequence[_Placed | None]) -> Segments:
    """Segments in the frames of their carriers that round parts are within a radius of; points at
    the origin for parts that are not round.
    """
    ends = np.zeros((len(parts), 2, 3))
    for k, part in enumerate(parts):
        if part is not None:
            ends[k] = part.part.shape.hull[0] @ part.pose.rotation.T + part.pose.position
    return Segments(ends[:, 0], ends[:, 1] - ends[:, 0])


def _ball(parts: Sequence[_Placed]) -> tuple[Array, float]:
    """A ball round parts, about the middle of their extent."""
    points, reach = [], []
    for part in parts:
        corners, beyond = part.part.shape.hull
        points.append(corners @ part.pose.rotation.T + part.pose.position)
        reach += [beyond] * len(corners)
    x, r = np.vstack(points), np.array(reach)[:, None]
    centre = ((x - r).min(axis=0) + (x + r).max(axis=0)) / 2
    return centre, float((np.linalg.norm(x - centre, axis=1) + r[:, 0]).max())
