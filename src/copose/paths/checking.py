"""Whether bodies keep clear of each other between the knots of a motion, at every time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.collision import Bodies, Carrier, configurations
from copose.paths.journey import Journey
from copose.planning.machinery import Machinery
from copose.poses import Array, Indices
from copose.progress import heed
from copose.robots import Arm

# What may be missing of the clearance, m: as much as at the knots.
_MISSING = 1e-6
# What part of the least distance at knots is proved where that is more than the clearance.
_PROVED = 0.9
# Halvings of an interval before a proof is given up, and once it has failed elsewhere.
_HALVINGS, _ROUGHLY = 12, 5


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
    machinery: Machinery,
    journey: Journey,
    q: Sequence[Array],
    rates: Sequence[Array],
    duration: float,
) -> Between:
    """Conservative advancement: in a time h the distance of two bodies changes by L h at most, L
    the largest speed of a point of one as the other sees it, so that it is (d + d' − L h)/2 or more
    between two instants. Where that is too little the time between them is halved.

    Args:
        machinery: what knows the bodies.
        journey: the object's.
        q: joints at the knots, by arm (n, n_i).
        rates: alike.
        duration: s.
    """
    if machinery.bodies is None or not len(machinery.bodies.pairs):
        return Between(None, 0.0)
    way = _Way(machinery, journey, np.hstack(q), np.hstack(rates), duration)
    bodies = machinery.bodies
    knots = [bodies.nearest(way.at(k, 0.0)) for k in range(len(way))]
    knots.append(bodies.nearest(way.at(len(way) - 1, 1.0)))
    least = min(each.distance for each in knots if each is not None)
    goal = bodies.clearance - _MISSING
    if _PROVED * least > goal and _least(way, _PROVED * least) is None:
        return Between(_PROVED * least, 0.0)
    met = _least(way, goal)
    if met is None:
        return Between(goal, 0.0)
    return Between(met, bodies.clearance - met)


def _least(way: _Way, goal: float) -> float | None:
    """None where bodies are farther apart than a goal at every time, else the least that is met."""
    bodies, met = way.bodies, np.inf
    for k in range(len(way)):
        heed()
        parts = [(0.0, 1.0, bodies.every)]
        while parts:
            a, b, pairs = parts.pop()
            drop = way.speeds(k, a, b)[pairs] * (b - a) * way.step
            ends = [bodies.placed(way.at(k, u)[None])[0] for u in (a, b)]
            for measured in (bodies.bounds, bodies.hull_distances, bodies.distances):
                apart = [measured(where, pairs) for where in ends]
                if measured == bodies.distances:
                    met = min(met, *(found.min() for found in apart))
                sure = (apart[0] + apart[1] - drop) / 2
                left = sure < goal
                pairs, drop, sure = pairs[left], drop[left], sure[left]
                if not len(pairs):
                    break
            else:
                if b - a > 0.5 ** (_HALVINGS if met >= goal else _ROUGHLY):
                    middle = (a + b) / 2
                    parts += [(a, middle, pairs), (middle, b, pairs)]
                elif met >= goal:
                    met = float(sure.min())
    return None if met >= goal else met


class _Way:
    """A motion, instant by instant: cubic in every interval."""

    def __init__(
        self, machinery: Machinery, journey: Journey, q: Array, rates: Array, duration: float
    ) -> None:
        assert machinery.bodies is not None
        self.bodies: Bodies = machinery.bodies
        self._arms, self._journey, self._duration = machinery.cell.arms, journey, duration
        self._split = machinery.split
        self._count = len(q) - 1
        self.step = duration / self._count
        rise, slope = np.diff(q, axis=0), self.step * rates
        # q + u (slope + u (square + u cube)), u from 0 to 1.
        self._terms = (
            q[:-1], slope[:-1], 3 * rise - 2 * slope[:-1] - slope[1:],
            slope[:-1] + slope[1:] - 2 * rise,
        )  # fmt: skip
        self._reach = _reaches(self.bodies, self._arms)
        held = np.array([s.carrier.kind == "object" for s in self.bodies.solids])
        far = np.linalg.norm(self.bodies.centres, axis=1) + self.bodies.radii
        # Of the object's turning, m; 1 of its moving.
        ends = self.bodies.pairs
        self._turned = np.max(np.where(held, far, 0.0)[ends], axis=1)
        self._moved = held[ends].any(axis=1)

    def __len__(self) -> int:
        return self._count

    def at(self, k: int, u: float) -> Array:
        """The configuration at a part of interval k, (size,)."""
        q, slope, square, cube = (term[k] for term in self._terms)
        joints = self._split((q + u * (slope + u * (square + u * cube)))[None])
        pose = self._journey.at((k + u) / self._count).pose
        bases = [arm.base for arm in self._arms]
        return np.asarray(configurations(self._arms, bases, joints, pose)[0])

    def speeds(self, k: int, a: float, b: float) -> Array:
        """The largest speeds of points of one of a pair that the other sees, m/s, (p,)."""
        _, slope, square, cube = (term[k] for term in self._terms)
        with np.errstate(divide="ignore", invalid="ignore"):
            turning = np.clip(np.nan_to_num(-square / (3 * cube)), a, b)
        fastest = np.max(
            [np.abs(slope + u * (2 * square + 3 * u * cube)) for u in (a, b, turning)], axis=0
        ) / self.step  # fmt: skip
        found = self._reach @ fastest
        linear = angular = 0.0
        low, high = (k + a) / self._count, (k + b) / self._count
        for each in self._journey.segments:
            if each.begins <= high and low <= each.begins + each.share:
                # Minimum jerk is fastest half way.
                phase = float(np.clip(each.begins + each.share / 2, low, high))
                velocity = each.at(phase).velocity / self._duration
                linear = max(linear, float(np.linalg.norm(velocity[:3])))
                angular = max(angular, float(np.linalg.norm(velocity[3:])))
        return np.asarray(found + self._moved * linear + self._turned * angular)


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
