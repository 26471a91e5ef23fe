"""A motion as cubics between knots: distances of bodies at instants, and bounds on their change."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from copose.collision import Bodies, Carrier, PartPoses, Placements, configurations
from copose.motion.path import minimum_jerk
from copose.motion.path.object_motion import ObjectMotion
from copose.poses import Array, Indices
from copose.posture.model import PostureModel
from copose.robots import Arm


class CubicMotion:
    """A motion that is cubic in every interval between knots, each divided into instants.

    Queries name instants by the rows that `rows` gives them and pairs of bodies' parts by number;
    what was computed for an instant is kept.

    Attributes:
        pairs: the tested pair of bodies that each pair of parts belongs to, (p,).
        step: time between knots, s.
        instants: in an interval.
    """

    def __init__(
        self,
        model: PostureModel,
        journey: ObjectMotion,
        q: Array,
        rates: Array,
        duration: float,
        instants: int = 4096,
    ) -> None:
        assert model.bodies is not None
        self._bodies: Bodies = model.bodies
        self._arms, self._journey, self._duration = model.cell.arms, journey, duration
        self._split = model.split
        self._count, self.instants = len(q) - 1, instants
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
        self._places: list[PartPoses] = []
        self._balls = np.zeros((0, len(ends)))
        self._hulls: dict[tuple[int, int], tuple[float, Array]] = {}
        self._distances: dict[tuple[int, int], float] = {}

    def __len__(self) -> int:
        return self._count

    def least_at_knots(self) -> float:
        """The smallest distance at the knots, m."""
        rows, least = self.rows(np.arange(self._count + 1) * self.instants), np.inf
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
                self._places.append(PartPoses(where[k]))
            self._balls = np.vstack([self._balls, self._bodies.bounds(where, self._bodies.every)])
        return np.array([self._row[t] for t in every.tolist()], dtype=np.intp)[places]

    def balls(self, rows: Indices, parts: Indices) -> Array:
        """Distances of balls round the bodies, m, (m,)."""
        return np.asarray(self._balls[rows, self.pairs[parts]])

    def hulls(self, rows: Indices, parts: Indices) -> tuple[Array, Array]:
        """Distances of the hulls, m, (m,), and their directions, (m, 3)."""
        gaps = [self._hull(row, k) for row, k in zip(rows.tolist(), parts.tolist(), strict=True)]
        return np.array([gap for gap, _ in gaps]), np.reshape([n for _, n in gaps], (-1, 3))

    def distances(self, rows: Indices, parts: Indices) -> Array:
        """Distances of the bodies, m, (m,)."""
        both = zip(rows.tolist(), parts.tolist(), strict=True)
        return np.array([self._distance(row, k) for row, k in both])

    def spans(self, first: Indices, second: Indices, parts: Indices, normals: Array) -> Array:
        """Lower bounds on the distance of hulls at two instants, m, (m,), along directions given at
        the first, (m, 3), that go with the frame in which the hulls are looked at.
        """
        spans = np.empty(len(parts))
        for k in np.unique(parts).tolist():
            of_pair, frame = np.flatnonzero(parts == k), self._frames[self.pairs[k]]
            before, after = (self._placed(rows[of_pair]) for rows in (first, second))
            own = normals[of_pair, None] @ before.rotations[:, frame]
            turned = (own @ after.rotations[:, frame].swapaxes(1, 2))[:, 0]
            spans[of_pair] = np.minimum(
                self._bodies.spans(before, k, normals[of_pair]),
                self._bodies.spans(after, k, turned),
            )
        return spans

    def _placed(self, rows: Indices) -> Placements:
        """Poses of the carriers at instants."""
        where = [self._where[row] for row in rows.tolist()]
        return Placements(
            np.array([at.rotations for at in where]), np.array([at.positions for at in where])
        )

    def rates(self, begin: Indices, span: int, parts: Indices) -> tuple[Array, Array]:
        """The largest speed and acceleration, m/s and m/s², of a point of one of two parts that the
        other sees between instants; (m,) each.
        """
        begin, which = np.unique(begin, return_inverse=True)
        k = begin // self.instants
        a, b = ((t / self.instants - k)[:, None] for t in (begin, begin + span))
        _, slope, square, cube = (term[k] for term in self._terms)
        with np.errstate(divide="ignore", invalid="ignore"):
            turning = np.clip(np.nan_to_num(-square / (3 * cube)), a, b)
        fastest = np.max(
            [np.abs(slope + u * (2 * square + 3 * u * cube)) for u in (a, b, turning)], axis=0
        ) / self.step  # fmt: skip
        swung = np.max([np.abs(2 * square + 6 * u * cube) for u in (a, b)], axis=0) / self.step**2
        # |∂²p/∂q_l ∂q_m| is no more than |∂p/∂q_m|, m the joint that comes after.
        before = np.hstack([np.cumsum(arm, axis=1) - arm for arm in self._split(fastest)])
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
        low, high = (t[:, None] / (self.instants * self._count) for t in (begin, end))
        largest, extremes = np.zeros((2, 2, len(begin), 1)), minimum_jerk.extremes()
        for segment in self._journey.segments:
            phases = np.clip(segment.begins + segment.share * extremes, low, high)
            x = (np.hstack([low, high, phases]) - segment.begins) / segment.share
            x = np.clip(x, 0.0, 1.0)
            speed, bend = minimum_jerk.speed(x), minimum_jerk.acceleration(x)
            most = [
                np.abs(rate).max(axis=1, keepdims=True) / (segment.share * self._duration) ** power
                for power, rate in ((1, speed), (2, bend))
            ]
            sizes = [float(np.linalg.norm(size)) for size in (segment.step, segment.turn)]
            largest = np.maximum(largest, [[size * rate for rate in most] for size in sizes])
        return (largest[0, 0], largest[0, 1]), (largest[1, 0], largest[1, 1])

    def _at(self, instants: Indices) -> Array:
        """Configurations, (count, size)."""
        k = np.minimum(instants // self.instants, self._count - 1)
        u = (instants / self.instants - k)[:, None]
        q, slope, square, cube = (term[k] for term in self._terms)
        joints = self._split(q + u * (slope + u * (square + u * cube)))
        phases = instants / (self.instants * self._count)
        poses = [state.pose for state in self._journey.states(phases)]
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
    """Carriers in whose frame pairs are looked at, (p,): the one nearer to the base of two of one
    arm, else the world.
    """
    frames = np.zeros(len(bodies.pairs), dtype=np.intp)
    for k, pair in enumerate(bodies.pairs):
        one, other = (bodies.solids[s].carrier for s in pair)
        if one.kind == other.kind == "joint" and one.arm == other.arm:
            frames[k] = bodies.carrier[min(pair, key=lambda s: bodies.solids[s].carrier.joint)]
    return frames


def _reaches(bodies: Bodies, arms: Sequence[Arm]) -> Array:
    """Bounds on how far points of one of a pair move, as the other sees it, for a rad or m of every
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
    reaches: Array = own[bodies.pairs].sum(axis=1)
    for row, (a, b) in zip(reaches, bodies.pairs, strict=True):
        _together(row, bodies.solids[a].carrier, bodies.solids[b].carrier, first)
    return reaches


def _together(row: Array, one: Carrier, other: Carrier, first: Indices) -> None:
    """Zeros for joints that move both of two solids: neither moves as the other sees it."""
    if one.kind == other.kind == "joint" and one.arm == other.arm:
        begin = first[one.arm]
        row[begin : begin + min(one.joint, other.joint) + 1] = 0.0
