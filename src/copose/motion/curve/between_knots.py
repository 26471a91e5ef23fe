"""Whether bodies keep clear of each other between the knots of a motion, at every time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.collision import Bodies, Carrier, Placements, Places, configurations
from copose.motion.path.object_motion import ObjectMotion
from copose.poses import Array, Indices
from copose.posture.model import PostureModel
from copose.progress import heed
from copose.robots import Arm

# What may be missing of the clearance, m: as much as at the knots.
_MISSING = 1e-6
# What part of the least distance at knots is proved where that is more than the clearance.
_PROVED = 0.9
# Halvings of an interval before a proof is given up, and once it has failed elsewhere.
_HALVINGS, _ROUGHLY = 12, 5
# Instants in an interval.
_INSTANTS = 2**_HALVINGS
# Parts of a segment at which minimum jerk is fastest, and has its largest accelerations.
_PEAKS = np.array([0.5, 0.5 - np.sqrt(3) / 6, 0.5 + np.sqrt(3) / 6])


@dataclass(frozen=True)
class Between:
    """What bodies keep between knots.

    Attributes:
        distance: what they keep at every time, m; None where none is tested. Where that is not
            proved, the least that was met.
        missing: how much that is less than the clearance, m.
    """

    distance: float | None
    missing: float


def between_bodies(
    model: PostureModel,
    journey: ObjectMotion,
    q: Sequence[Array],
    rates: Sequence[Array],
    duration: float,
) -> Between:
    """Conservative advancement. In a time h the distance of two bodies changes by L h at most, L
    the largest speed of a point of one as the other sees it, so that it is (d + d' − L h)/2 or more
    between two instants. How far hulls are apart along a direction, min(g, g') − A h²/8 or more
    with A the largest acceleration, bounds their distance. Where both are too little the time
    between the instants is halved.

    Args:
        model: what knows the bodies.
        journey: the object's.
        q: joints at the knots, by arm (n, n_i).
        rates: alike.
        duration: s.
    """
    if model.bodies is None or not len(model.bodies.pairs):
        return Between(None, 0.0)
    way = _Way(model, journey, np.hstack(q), np.hstack(rates), duration)
    goal, least = model.bodies.clearance - _MISSING, way.least_at_knots()
    if _PROVED * least > goal and _least(way, _PROVED * least, roughly=True) is None:
        return Between(_PROVED * least, 0.0)
    met = _least(way, goal)
    if met is None:
        return Between(goal, 0.0)
    return Between(met, model.bodies.clearance - met)


def _least(way: _Way, goal: float, *, roughly: bool = False) -> float | None:
    """None where bodies are farther apart than a goal at every time, else the least that is met;
    ``roughly`` something less than the goal that is.
    """
    met = np.inf
    begin, parts = (grid.ravel() for grid in np.indices((len(way), len(way.pairs))))
    begin, span = begin * _INSTANTS, _INSTANTS
    for level in range(_HALVINGS + 1):
        heed()
        h = way.step * span / _INSTANTS
        speeds, bends = way.rates(begin, span, parts)
        drop, sag = speeds * h, bends * h**2 / 8
        ends = way.rows(begin), way.rows(begin + span)
        left = (way.balls(ends[0], parts) + way.balls(ends[1], parts) - drop) / 2 < min(goal, met)
        begin, parts, drop, sag = begin[left], parts[left], drop[left], sag[left]
        ends = ends[0][left], ends[1][left]
        (one, n), (other, m) = (way.hulls(rows, parts) for rows in ends)
        sure = (one + other - drop) / 2
        left = sure < min(goal, met)
        for first, second, normals in ((*ends, n), (*ends[::-1], m)):
            sure[left] = np.maximum(
                sure[left], way.spans(first[left], second[left], parts[left], normals[left])
                - sag[left],
            )  # fmt: skip
            left = sure < min(goal, met)
        close = np.flatnonzero(left & (np.minimum(one, other) < goal))
        if len(close):
            one, other = (way.distances(rows[close], parts[close]) for rows in ends)
            met = min(met, one.min(), other.min())
            sure[close] = np.maximum(sure[close], (one + other - drop[close]) / 2)
        left = sure < min(goal, met)
        begin, parts, sure = begin[left], parts[left], sure[left]
        if not len(parts) or (met < goal and (roughly or level >= _ROUGHLY)):
            break
        span //= 2
        begin, parts = np.concatenate([begin, begin + span]), np.tile(parts, 2)
    else:
        met = min(met, sure.min())
    return None if met >= goal else met


class _Way:
    """A motion, instant by instant: cubic in every interval, of which each has so many instants.

    What is asked of two parts of bodies is asked by rows of instants and by their number.

    Attributes:
        pairs: by number of two parts, that of the tested pair, (p,).
        step: time between knots, s.
    """

    def __init__(
        self, model: PostureModel, journey: ObjectMotion, q: Array, rates: Array, duration: float
    ) -> None:
        assert model.bodies is not None
        self._bodies: Bodies = model.bodies
        self._arms, self._journey, self._duration = model.cell.arms, journey, duration
        self._split = model.split
        self._count = len(q) - 1
        self.pairs, self.step = self._bodies.parts, duration / self._count
        rise, slope = np.diff(q, axis=0), self.step * rates
        # q + u (slope + u (square + u cube)), u from 0 to 1.
        self._terms = (
            q[:-1], slope[:-1], 3 * rise - 2 * slope[:-1] - slope[1:],
            slope[:-1] + slope[1:] - 2 * rise,
        )  # fmt: skip
        self._reach = _reaches(self._bodies, self._arms)
        held = np.array([s.carrier.kind == "object" for s in self._bodies.solids])
        far = np.linalg.norm(self._bodies.centres, axis=1) + self._bodies.radii
        # Of the object's turning, m; 1 of its moving.
        ends = self._bodies.pairs
        self._turned = np.max(np.where(held, far, 0.0)[ends], axis=1)
        self._moved = held[ends].any(axis=1)
        self._frames = _frames(self._bodies)
        self._row: dict[int, int] = {}
        self._where: list[Placements] = []
        self._places: list[Places] = []
        self._balls = np.zeros((0, len(ends)))
        self._hulls: dict[tuple[int, int], tuple[float, Array]] = {}
        self._distances: dict[tuple[int, int], float] = {}

    def __len__(self) -> int:
        return self._count

    def least_at_knots(self) -> float:
        """The smallest distance at the knots, m."""
        rows, least = self.rows(np.arange(self._count + 1) * _INSTANTS), np.inf
        parts = [np.flatnonzero(self.pairs == pair) for pair in self._bodies.every]
        bounds = self._balls[rows]
        for number in np.argsort(bounds, axis=None):
            k, pair = divmod(int(number), bounds.shape[1])
            if bounds[k, pair] >= least:
                break
            for part in parts[pair].tolist():
                if self._hull(rows[k], part)[0] < max(least, 0.0):
                    least = min(least, self._distance(rows[k], part))
        return least

    def rows(self, instants: Indices) -> Indices:
        """Numbers of instants."""
        every, places = np.unique(instants, return_inverse=True)
        new = np.array([t for t in every.tolist() if t not in self._row], dtype=np.intp)
        if len(new):
            where = self._bodies.placed(self._at(new))
            for t, k in zip(new.tolist(), range(len(new)), strict=True):
                self._row[t] = len(self._where)
                self._where.append(where[k])
                self._places.append(Places(where[k]))
            self._balls = np.vstack([self._balls, self._bodies.bounds(where, self._bodies.every)])
        return np.array([self._row[t] for t in every.tolist()], dtype=np.intp)[places]

    def balls(self, rows: Indices, parts: Indices) -> Array:
        """Distances of balls round the bodies, m, (m,)."""
        return np.asarray(self._balls[rows, self.pairs[parts]])

    def hulls(self, rows: Indices, parts: Indices) -> tuple[Array, Array]:
        """Distances of the hulls, m, (m,), and their directions, (m, 3)."""
        found = [self._hull(row, k) for row, k in zip(rows.tolist(), parts.tolist(), strict=True)]
        return np.array([each[0] for each in found]), np.reshape([n for _, n in found], (-1, 3))

    def distances(self, rows: Indices, parts: Indices) -> Array:
        """Distances of the bodies, m, (m,)."""
        both = zip(rows.tolist(), parts.tolist(), strict=True)
        return np.array([self._distance(row, k) for row, k in both])

    def spans(self, first: Indices, second: Indices, parts: Indices, normals: Array) -> Array:
        """How far apart hulls are at the least at two instants along a direction that goes with the
        frame in which they move, given at the first, (m, 3); m, (m,).
        """
        found = np.empty(len(parts))
        for k in np.unique(parts).tolist():
            mine, frame = np.flatnonzero(parts == k), self._frames[self.pairs[k]]
            here, there = (Placements(
                np.array([self._where[row].rotations for row in rows[mine].tolist()]),
                np.array([self._where[row].positions for row in rows[mine].tolist()]),
            ) for rows in (first, second))  # fmt: skip
            own = normals[mine, None] @ here.rotations[:, frame]
            turned = (own @ there.rotations[:, frame].swapaxes(1, 2))[:, 0]
            found[mine] = np.minimum(
                self._bodies.spans(here, k, normals[mine]), self._bodies.spans(there, k, turned)
            )
        return found

    def rates(self, begin: Indices, span: int, parts: Indices) -> tuple[Array, Array]:
        """The largest speed and acceleration, m/s and m/s², of a point of one of two parts that the
        other sees between instants; (m,) each.
        """
        begin, which = np.unique(begin, return_inverse=True)
        k = begin // _INSTANTS
        a, b = ((t / _INSTANTS - k)[:, None] for t in (begin, begin + span))
        _, slope, square, cube = (term[k] for term in self._terms)
        with np.errstate(divide="ignore", invalid="ignore"):
            turning = np.clip(np.nan_to_num(-square / (3 * cube)), a, b)
        fastest = np.max(
            [np.abs(slope + u * (2 * square + 3 * u * cube)) for u in (a, b, turning)], axis=0
        ) / self.step  # fmt: skip
        swung = np.max([np.abs(2 * square + 6 * u * cube) for u in (a, b)], axis=0) / self.step**2
        # |∂²p/∂q_l ∂q_m| is no more than |∂p/∂q_m|, m the joint that comes after.
        before = np.hstack([np.cumsum(each, axis=1) - each for each in self._split(fastest)])
        swung += fastest * (fastest + 2 * before)
        (linear, bent), (angular, curled) = self._object_rates(begin, begin + span)
        speeds = fastest @ self._reach.T + linear * self._moved + angular * self._turned
        bends = swung @ self._reach.T + bent * self._moved + (curled + angular**2) * self._turned
        pairs = self.pairs[parts]
        return speeds[which, pairs], bends[which, pairs]

    def _object_rates(
        self, begin: Indices, end: Indices
    ) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """The object's largest speed and acceleration between instants, (count, 1) each, and those
        of its turning.
        """
        low, high = (t[:, None] / (_INSTANTS * self._count) for t in (begin, end))
        found = np.zeros((2, 2, len(begin), 1))
        for each in self._journey.segments:
            phases = np.clip(each.begins + each.share * _PEAKS, low, high)
            x = np.clip((np.hstack([low, high, phases]) - each.begins) / each.share, 0.0, 1.0)
            speed, bend = 30 * x**2 * (1 - x) ** 2, 60 * x * (1 - x) * (1 - 2 * x)
            most = [
                np.abs(rate).max(axis=1, keepdims=True) / (each.share * self._duration) ** power
                for power, rate in ((1, speed), (2, bend))
            ]
            sizes = [float(np.linalg.norm(size)) for size in (each.step, each.turn)]
            found = np.maximum(found, [[size * rate for rate in most] for size in sizes])
        return (found[0, 0], found[0, 1]), (found[1, 0], found[1, 1])

    def _at(self, instants: Indices) -> Array:
        """Configurations, (count, size)."""
        k = np.minimum(instants // _INSTANTS, self._count - 1)
        u = (instants / _INSTANTS - k)[:, None]
        q, slope, square, cube = (term[k] for term in self._terms)
        joints = self._split(q + u * (slope + u * (square + u * cube)))
        phases = instants / (_INSTANTS * self._count)
        poses = [self._journey.at(float(phase)).pose for phase in phases]
        return configurations(self._arms, [arm.base for arm in self._arms], joints, poses)

    def _hull(self, row: int, k: int) -> tuple[float, Array]:
        if (row, k) not in self._hulls:
            self._hulls[row, k] = self._bodies.hull_gap(self._places[row], k)
        return self._hulls[row, k]

    def _distance(self, row: int, k: int) -> float:
        if (row, k) not in self._distances:
            self._distances[row, k] = self._bodies.gap(self._places[row], k)
        return self._distances[row, k]


def _frames(bodies: Bodies) -> Indices:
    """The carrier in whose frame each pair is looked at: the first of two of one arm, else the
    world, (p,).
    """
    found = np.zeros(len(bodies.pairs), dtype=np.intp)
    for k, pair in enumerate(bodies.pairs):
        one, other = (bodies.solids[s].carrier for s in pair)
        if one.kind == other.kind == "joint" and one.arm == other.arm:
            found[k] = bodies.carrier[min(pair, key=lambda s: bodies.solids[s].carrier.joint)]
    return found


def _reaches(bodies: Bodies, arms: Sequence[Arm]) -> Array:
    """How far points of one of a pair move at most, as the other sees it, for a rad or m of every
    joint, (p, N).
    """
    first = np.cumsum([0, *(arm.n for arm in arms)])
    own = np.zeros((len(bodies.solids), first[-1]))
    for s, solid in enumerate(bodies.solids):
        carrier = solid.carrier
        if carrier.kind != "joint":
            continue
        arm = arms[carrier.arm]
        far = float(np.linalg.norm(bodies.centres[s]) + bodies.radii[s])
        for j in range(carrier.joint, -1, -1):
            joint = arm.joints[j]
            slides = joint.kind == "prismatic"
            own[s, first[carrier.arm] + j] = 1.0 if slides else far
            far += float(np.linalg.norm(joint.placement.position))
            far += max(abs(joint.lower), abs(joint.upper)) if slides else 0.0
    found: Array = own[bodies.pairs].sum(axis=1)
    for row, (a, b) in zip(found, bodies.pairs, strict=True):
        _together(row, bodies.solids[a].carrier, bodies.solids[b].carrier, first)
    return found


def _together(row: Array, one: Carrier, other: Carrier, first: Indices) -> None:
    """Joints that move both of two solids move neither as the other sees it."""
    if one.kind == other.kind == "joint" and one.arm == other.arm:
        begin = first[one.arm]
        row[begin : begin + min(one.joint, other.joint) + 1] = 0.0
