"""The object's path: straight from waypoint to waypoint with minimum jerk, and its rates."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from copose.motion.path import minimum_jerk
from copose.poses import (
    Array,
    Pose,
    conjugate,
    quaternion_product,
    rotation_vector,
    turn_quaternions,
)
from copose.problem import Problem


@dataclass(frozen=True, eq=False)
class ObjectState:
    """The object's pose and rates at an instant, rates by the share φ of the path's duration."""

    pose: Pose  # of its centre of mass in the world
    velocity: Array  # dp/dφ, m, over the angular velocity by φ, rad, world axes, (6,)
    acceleration: Array  # alike, by φ twice, (6,)


@dataclass(frozen=True, eq=False)
class Segment:
    """The way from a waypoint straight to the next, turning about one axis by the least angle."""

    first: Pose  # pose at its beginning
    step: Array  # displacement, m, (3,)
    turn: Array  # rotation vector in world axes, rad, (3,)
    begins: float  # φ at its beginning
    share: float  # of the duration


@dataclass(frozen=True, eq=False)
class ObjectMotion:
    """The object's way through its waypoints, by minimum jerk from rest to rest on every segment.

    Durations of segments are in proportion to max(length, 0.3 m · angle). Time is told as φ, the
    share of the whole duration that is behind: the same journey in another time is the same
    function of φ.
    """

    segments: tuple[Segment, ...]  # in order; one of no length where nothing moves

    @classmethod
    def of(cls, problem: Problem) -> ObjectMotion:
        """The object's path of ``[path]``; without one the object stays."""
        poses = waypoint_poses(problem)
        steps = [b.position - a.position for a, b in pairwise(poses)]
        turns = [_turn(a, b) for a, b in pairwise(poses)]
        sizes = np.array([_size(s, t) for s, t in zip(steps, turns, strict=True)])
        if not sizes.any():
            nothing = np.zeros(3)
            return cls((Segment(poses[0], nothing, nothing, 0.0, 1.0),))
        shares = sizes / sizes.sum()
        begins = np.concatenate([[0.0], np.cumsum(shares)])
        return cls(
            tuple(
                Segment(pose, step, turn, float(begin), float(share))
                for pose, step, turn, begin, share in zip(
                    poses[:-1], steps, turns, begins[:-1], shares, strict=True
                )
                if share > 0
            )
        )

    @cached_property
    def size(self) -> float:
        """Total size, Σ max(length, 0.3 m · angle), m."""
        return sum(_size(segment.step, segment.turn) for segment in self.segments)

    @property
    def still(self) -> bool:
        """True where the object stays in its place."""
        return self.size < 1e-9

    @property
    def fastest(self) -> float:
        """The largest derivative of the size by φ, m."""
        sizes = [_size(s.step, s.turn) / s.share for s in self.segments]
        return minimum_jerk.speed(0.5) * max(sizes)

    @property
    def speed(self) -> float:
        """The largest speed of the centre of mass by φ, m."""
        lengths = [float(np.linalg.norm(s.step)) / s.share for s in self.segments]
        return minimum_jerk.speed(0.5) * max(lengths)

    def at(self, phase: float) -> ObjectState:
        """The object at a share of the duration."""
        return self.states(np.array([phase]))[0]

    def states(self, phases: Array) -> tuple[ObjectState, ...]:
        """The object at many instants."""
        instants = zip(*self._along(phases), strict=True)
        return tuple(ObjectState(_pose(p, q), *rates) for p, q, *rates in instants)

    def places(self, phases: Array) -> tuple[Array, Array]:
        """Positions, (count, 3), and quaternions, (count, 4), at many instants."""
        positions, quaternions, *_ = self._along(phases)
        return positions, quaternions

    def _along(self, phases: Array) -> tuple[Array, Array, Array, Array]:
        """Places, and rates of `ObjectState`, at many instants by the minimum-jerk law."""
        begins = np.array([segment.begins for segment in self.segments])
        which = np.maximum(np.searchsorted(begins, phases, side="right") - 1, 0)
        ways = [
            (s.first.position, s.first.quaternion, s.step, s.turn, s.share) for s in self.segments
        ]
        first, quaternion, step, turn, share = (
            np.array(part)[which] for part in zip(*ways, strict=True)
        )
        x = np.clip((phases - begins[which]) / share, 0.0, 1.0)[:, None]
        share, s = share[:, None], minimum_jerk.travelled(x)
        turned = quaternion_product(turn_quaternions(s * turn).T, quaternion.T)
        along = np.hstack([step, turn])
        return (
            first + s * step,
            np.stack(turned, axis=1),
            minimum_jerk.speed(x) / share * along,
            minimum_jerk.acceleration(x) / share**2 * along,
        )

    @property
    def returns(self) -> bool:
        """True where it ends in the pose that it began with."""
        first, last = self.at(0.0).pose, self.at(1.0).pose
        return bool(
            np.allclose(first.position, last.position, rtol=0, atol=1e-9)
            and np.linalg.norm(_turn(first, last)) < 1e-9
        )


def waypoint_poses(problem: Problem) -> list[Pose]:
    """Poses of the object at the waypoints of ``[path]``, what a waypoint leaves out as before it;
    without a path the object's pose twice.
    """
    thing, planar, path = problem.object, problem.space.planar, problem.path
    if path is None:
        return [thing.pose, thing.pose]
    position = thing.position
    turn = (getattr(thing, "angle" if planar else "rpy"),)
    poses = []
    for waypoint in path.waypoints:
        position = position if waypoint.position is None else waypoint.position
        own = getattr(waypoint, "angle" if planar else "rpy")
        turn = turn if own is None else (own,)
        rpy = (0.0, 0.0, turn[0]) if planar else turn[0]
        poses.append(Pose.from_rpy((*position, 0.0)[:3], rpy))
    return poses


def _size(step: Array, turn: Array) -> float:
    """The size of a displacement, m: its length, or 0.3 m a rad of its turn if that is more."""
    return float(max(np.linalg.norm(step), 0.3 * np.linalg.norm(turn)))


def _turn(a: Pose, b: Pose) -> Array:
    """The rotation vector, world axes, that turns a into b by the shortest angle."""
    return rotation_vector(quaternion_product(b.quaternion, conjugate(a.quaternion)))


def _pose(position: Array, quaternion: Array) -> Pose:
    # By way of roll, pitch and yaw, which a problem is told: one pose for all that is computed.
    return Pose.from_rpy(position, Pose.from_quaternion(position, quaternion).rpy)
