"""Tracing of self-motions with one degree of freedom, from many postures at once.

{q : closure(q) = 0, lower ≤ q ≤ upper} of an arm with one degree of freedom to spare is made of
curves in the space of joint angles, which no limited joint leaves by a turn: arcs from limit to
limit, and loops. A curve is traced from a posture both ways, by two fronts. A step goes along the
tangent and back onto the curve in the plane across it, and counts only if it is straight, and if
det [J; tᵀ], t the tangent, keeps its sign: another curve nearby has the other one. Where curves
meet det vanishes, and there a front ends. Two fronts that face each other on one curve meet.

`follow` traces each curve by itself, up to limits; `connections` tells which postures are on one
curve; `Loops` covers all self-motions of an arm by
points, limits aside: its fronts meet whichever comes along.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from copose.poses import Array, Indices, Mask
from copose.self_motion.curves.curve import Curve, TracingOptions
from copose.self_motion.manifold import ClosureManifold, CurveStep
from copose.self_motion.projection import CLOSED


def follow(
    manifold: ClosureManifold, q: Array, options: TracingOptions | None = None
) -> list[Curve]:
    """The self-motions through closed postures, one of each arm.

    Args:
        manifold: of the arms.
        q: their postures, (k, n).
        options: step lengths and tolerances.
    """
    fronts = Fronts(manifold, q, options or TracingOptions(), groups=np.arange(len(q)))
    while fronts.advance():
        pass
    ends = fronts.ends()
    return [_curve(fronts, k, ends) for k in range(len(q))]


def connections(
    manifold: ClosureManifold, q: Array, others: Array, options: TracingOptions
) -> list[tuple[bool | None, Indices]]:
    """For each arm, whether a self-motion connects two closed postures, traced from both, None
    where the traces do not tell; and the joints whose limits stop that through the first.

    Args:
        manifold: of the arms.
        q: a posture of each, (k, n).
        others: another, alike.
        options: step lengths and tolerances.
    """
    k = len(q)
    arms, met = np.arange(k), np.zeros(k, dtype=bool)
    # From beyond limits a trace may come within, but none goes back there.
    within = (manifold.excess(others, q) <= options.same).all(axis=1)
    groups = np.concatenate([arms, np.where(within, arms, k + arms)])
    fronts = Fronts(
        manifold.taken(np.tile(arms, 2)), np.vstack([q, others]), options, groups=groups
    )
    while fronts.advance():
        met[[one % k for one, other in fronts.meetings if one != other]] = True
        fronts.going &= ~met[fronts.seeds % k]
    stops = fronts.stops.reshape(2, 2, k)  # of both ways, from both postures
    whole = fronts.loops.reshape(2, k) | (stops >= 0).all(axis=0)
    whole = whole[0] | (whole[1] & within)
    return [
        (True if met[i] else False if whole[i] else None, stops[stops[:, 0, i] >= 0, 0, i])
        for i in range(k)
    ]


class Fronts:
    """Fronts that go along self-motions, two of each seed, until limits or others stop them.

    Attributes:
        going: which go on, (2k,).
        seeds: number of the seed of each, (2k,).
        meetings: pairs of seeds that are on one curve.
        loops: seeds whose fronts have met, (k,).
        stops: number of the joint whose limit stops each front, −1 where none does, (2k,).
        q: where they are, (2k, n).
        manifold: of their arms.
        options: step lengths and tolerances.
        trail: by step, numbers of fronts, their postures and tangents, and how far they came.
    """

    def __init__(
        self,
        manifold: ClosureManifold,
        q: Array,
        options: TracingOptions,
        *,
        groups: Indices,
        longest: Callable[[Array, Indices], Array] | None = None,
    ) -> None:
        """Fronts at closed postures.

        Args:
            manifold: of the postures' arms.
            q: the postures, (k, n).
            options: step lengths and tolerances.
            groups: number of the group of each seed, (k,): only fronts of one group meet.
            longest: lengths of steps, (count,), at postures of seeds by number, at most; else that
                of the options.
        """
        k, n = q.shape
        self.options, self._longest = options, longest
        self.seeds = np.tile(np.arange(k), 2)
        self.manifold, self.meetings = manifold.taken(self.seeds), list[tuple[int, int]]()
        kernels = manifold.kernels
        if kernels.tangent is None:
            raise ValueError("there is no curve without one degree of freedom to spare")
        values = kernels.tangent(q, manifold.goals)
        tangent, (residual, det, size) = values[:, :n], values[:, n:].T
        sound = (residual <= max(CLOSED, options.closed)) & (
            np.abs(det) > options.singular * size**kernels.m
        )
        self.q, self._tangent = q[self.seeds], np.vstack([tangent, -tangent])
        # Those of two groups are farther apart than steps go.
        self._places = np.hstack([self.manifold.embedded(self.q), 10.0 * groups[self.seeds, None]])
        self._square = (self._places**2).sum(axis=1)
        self._det, self._bend = np.concatenate([det, -det]), np.zeros((2 * k, n))
        self._length = options.first * self._most(self.q, self.seeds)
        self.going, self.stops = sound[self.seeds], np.full(2 * k, -1)
        self.loops = np.zeros(k, dtype=bool)
        self.trail = [(np.arange(k), q, tangent, self._length[:k])]
        self._limited = bool((np.isfinite(manifold.lower) | np.isfinite(manifold.upper)).any())
        self._left = options.steps

    def advance(self) -> bool:
        """One step of every front that goes on and need not wait; False if none goes on."""
        if not self._left or not self.going.any():
            return False
        self._left -= 1
        rows, length, partners = self._next()
        if not len(rows):
            return False
        manifold, q = self.manifold.taken(rows), self.q[rows]
        # Where curves meet there is no tangent: a step that comes to nothing is no step.
        with np.errstate(all="ignore"):
            step, det, shorter = self._tried(manifold, rows, length)
        on = shorter == length
        if not on.all():
            self._shorten(rows[~on], shorter[~on])
        aimed = (on & (partners != rows)).nonzero()[0]
        if len(aimed):
            offset = step.q[aimed] - self.q[partners[aimed]]
            missed = np.abs(manifold.taken(aimed).wrapped(offset)).max(axis=1)
            met = aimed[missed < self.options.same]
            on[met] = False
            self._meet(rows[met], partners[met])
        if self._limited:
            excess = manifold.excess(step.q, q)
            out = on & (excess > self.options.touching).any(axis=1)
            self.stops[rows[out]], self._length[rows[out]] = excess[out].argmax(axis=1), length[out]
            self.going[rows[out]], on[out] = False, False
        if on.all():
            self._move(manifold, rows, step, length, det)
        elif on.any():
            self._move(manifold.taken(on), rows[on], step.taken(on), length[on], det[on])
        return True

    def _next(self) -> tuple[Indices, Array, Indices]:
        """The next steps: fronts that need not wait, lengths, and the fronts that end steps which
        would pass them, themselves for none.

        Of two fronts that may pass each other in their next steps only one goes on.
        """
        count, length, reach = len(self.q), self._length.copy(), self._length + self.options.same
        partners = np.arange(count)
        one, other, ahead = self._facing()
        going = self.going.copy()
        going[other] = False
        for k in (ahead <= reach[one]).nonzero()[0]:
            a, b = one[k], other[k]
            if ahead[k] <= reach[a]:
                length[a], reach[a], partners[a] = ahead[k], ahead[k], b
        rows = going.nonzero()[0]
        return rows, length[rows], partners[rows]

    def _facing(self) -> tuple[Indices, Indices, Array]:
        """Pairs of fronts that face each other, nearer than their next steps go together, (k,)
        each, and distances along the steps of the first at which they pass the partners.
        """
        rows = self.going.nonzero()[0]
        t, length, places, square = self._tangent, self._length, self._places, self._square
        likeness = (2 * places[rows]) @ places.T
        likeness -= square
        least = square[rows] - (length[rows].max() + length.max()) ** 2
        row, other = divmod((likeness > least[:, None]).ravel().nonzero()[0], len(places))
        one = rows[row]
        near = likeness[row, other] > square[one] - (length[one] + length[other]) ** 2
        # Of two that go on each sees the other.
        near &= (one < other) | ~self.going[other]
        one, other = one[near], other[near]
        facing = np.einsum("ij,ij->i", t[one], t[other]) < 0
        one, other = one[facing], other[facing]
        if not len(one):
            return one, other, np.zeros(0)
        offset, along, ahead = self._ahead(one, self.q[other])
        facing = along > self.options.touching
        if self.options.arc > 0:
            met = facing.copy()
            met[facing] = self._joined(one[facing], other[facing], offset[facing])
            facing &= ~met & self.going[one]
        return one[facing], other[facing], ahead[facing]

    def _joined(self, one: Indices, other: Indices, offset: Array) -> Mask:
        """Mask of pairs of fronts that have met, for their tangents are those of an arc, (k,).

        Where they are more than a step apart a point half way is added.

        Args:
            one: numbers of fronts, (k,).
            other: of those that face them, alike.
            offset: from the ones to the partners, (k, n).
        """
        distance = np.sqrt((offset**2).sum(axis=1))
        way = offset / distance[:, None]
        t, against = self._tangent[one], self._tangent[other]
        off = t - against - 2 * (t * way).sum(axis=1, keepdims=True) * way
        nearest = np.full(len(self.q), np.inf)
        np.minimum.at(nearest, one, distance)
        np.minimum.at(nearest, other, distance)
        arcs = (off**2).sum(axis=1) < self.options.arc**2
        arcs &= (distance <= nearest[one]) & (distance <= nearest[other])
        self._meet(one[arcs], other[arcs])
        far = (arcs & (distance > self._length[one])).nonzero()[0]
        if len(far):
            half = distance[far] / 2
            middle = self.q[one[far]] + offset[far] / 2
            middle += half[:, None] / 4 * (t[far] + against[far])
            self.trail.append((one[far], middle, way[far], half))
        return np.asarray(arcs)

    def _ahead(self, rows: Indices, points: Array) -> tuple[Array, Array, Array]:
        """Offsets of postures from fronts, (k, n), their parts along the tangents, (k,), and the
        same where steps may pass the postures, infinite elsewhere.

        Args:
            rows: of the fronts, (k,).
            points: a posture of each, (k, n).
        """
        options = self.options
        offset = self.manifold.taken(rows).wrapped(points - self.q[rows])
        along = (offset * self._tangent[rows]).sum(axis=1)
        ahead = along > options.touching
        ahead &= (offset**2).sum(axis=1) <= (options.oblique * along) ** 2
        return offset, along, np.where(ahead, along, np.inf)

    def _tried(
        self, manifold: ClosureManifold, rows: Indices, length: Array
    ) -> tuple[CurveStep, Array, Array]:
        """Steps of fronts, det [J; tᵀ] at their ends, and lengths, shorter where they do not count.

        Args:
            manifold: of the fronts.
            rows: of the fronts, (k,).
            length: of their steps, (k,).
        """
        options, q, t = self.options, self.q[rows], self._tangent[rows]
        step = manifold.step(q, t, length, self._bend[rows], options.closed)
        det = step.orientation
        good = step.closed & (step.cosine > options.straight) & (det * self._det[rows] > 0)
        aside = step.q - q - length[:, None] * t
        good &= (aside**2).sum(axis=1) < (options.aside * length + options.touching) ** 2
        if self._limited:
            length = np.where(good, _turning(manifold, q, t, step.tangent, length, options), length)
        return step, det, np.where(good, length, length / 2)

    def _meet(self, rows: Indices, partners: Indices) -> None:
        """Stop fronts, (k,), at partners."""
        one, other = self.seeds[rows], self.seeds[partners]
        self.loops[one[one == other]] = True
        self.going[rows] = self.going[partners] = False
        self.meetings += zip(one.tolist(), other.tolist(), strict=True)

    def _move(
        self, manifold: ClosureManifold, rows: Indices, step: CurveStep, length: Array, det: Array
    ) -> None:
        """Move fronts to the ends of steps, and choose the next."""
        options, planned = self.options, self._length[rows]
        self.trail.append((rows, step.q, step.tangent, length))
        self._bend[rows] = (step.tangent - self._tangent[rows]) / length[:, None]
        self.q[rows], self._tangent[rows] = step.q, step.tangent
        self._places[rows, :-1] = manifold.embedded(step.q)
        self._square[rows] = (self._places[rows] ** 2).sum(axis=1)
        longer = np.where(step.cosine > options.very_straight, options.growth * planned, planned)
        longer = np.minimum(longer, self._most(step.q, self.seeds[rows]))
        # Where curves meet det vanishes: what would pass such a place has to come up to it.
        falling = np.maximum(1.0 - det / self._det[rows], 1e-9)
        longer = np.minimum(longer, options.room * length * (1.0 - falling) / falling)
        self._det[rows] = det
        self._shorten(rows, longer)

    def _shorten(self, rows: Indices, length: Array) -> None:
        """Set lengths of next steps; fronts for which they are too short end."""
        self._length[rows] = length
        self.going[rows[length < self.options.shortest]] = False

    def _most(self, q: Array, seeds: Indices) -> Array:
        """The longest steps at postures of seeds, (count,)."""
        longest = self.options.longest
        return np.full(len(q), longest) if self._longest is None else self._longest(q, seeds)

    def ends(self) -> dict[int, tuple[Array, Array]]:
        """Posture, (n,), and tangent at the limit that stops each front, by its number."""
        rows = (self.stops >= 0).nonzero()[0]
        manifold, q, t = self.manifold.taken(rows), self.q[rows], self._tangent[rows]
        low, high, ends = np.zeros(len(rows)), self._length[rows], (q.copy(), t.copy())
        for _ in range(self.options.halvings):
            middle = (low + high) / 2
            step = manifold.step(q, t, middle, self._bend[rows], self.options.closed_well)
            within = step.closed & (manifold.excess(step.q, q) <= 0).all(axis=1)
            low, high = np.where(within, middle, low), np.where(within, high, middle)
            for end, reached in zip(ends, (step.q, step.tangent), strict=True):
                end[within] = reached[within]
        return {int(rows[k]): (ends[0][k], ends[1][k]) for k in (low > CLOSED).nonzero()[0]}


def _curve(fronts: Fronts, seed: int, ends: dict[int, tuple[Array, Array]]) -> Curve:
    """The traced curve of a seed, from the end of one of its fronts to that of the other."""
    both = (fronts.seeds == seed).nonzero()[0]
    halves = []
    for row in both:
        parts = [(q[rows == row], t[rows == row]) for rows, q, t, _ in fronts.trail]
        parts += [(q[None], t[None]) for number, (q, t) in ends.items() if number == row]
        halves.append([np.vstack(part) for part in zip(*parts, strict=True)])
    forward, (back, against) = halves[0], halves[1]
    backward, loop = (back[::-1], -against[::-1]), bool(fronts.loops[seed])
    points, tangents = (
        np.vstack(part)
        for part in zip(*((forward, backward) if loop else (backward, forward)), strict=True)
    )
    stops = fronts.stops[both]
    return Curve(
        points=points,
        tangents=tangents,
        loop=loop,
        complete=loop or bool((stops >= 0).all()),
        stops=tuple(int(stop) for stop in stops if stop >= 0),
        manifold=fronts.manifold.taken(np.array([seed])),
        options=fronts.options,
    )


def _turning(
    manifold: ClosureManifold,
    q: Array,
    t: Array,
    ahead: Array,
    length: Array,
    options: TracingOptions,
) -> Array:
    """Lengths of steps, shorter where a joint turns back on the way, maybe beyond a limit: (k,).

    Args:
        manifold: of the fronts.
        q: where the steps begin, (k, n).
        t: tangents there, (k, n).
        ahead: tangents at their ends, (k, n).
        length: of the steps, (k,).
        options: of tracing.
    """
    speed, slower = np.abs(t), np.abs(ahead)
    turns = t * ahead < 0
    if not turns.any():
        return length
    total = np.where(turns, speed + slower, 1.0)
    depth = length[:, None] * speed**2 / (2 * total)
    beyond = manifold.excess(q + np.sign(t) * (1 + options.unsure) * depth, q) > 0
    least = np.minimum(depth, length[:, None] * slower**2 / (2 * total))
    doubtful = turns & beyond & (least > options.shallow)
    part = np.where(doubtful, np.clip(speed / total, 0.1, 0.8), 1.0).min(axis=1)
    return np.asarray(length * part)
