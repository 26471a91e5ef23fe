"""Bounds on the reach of an arm from its link lengths and joint limits."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from copose.poses import Array, Pose, rotation_rows
from copose.robots.arm import Arm, Joint


def levers(arm: Arm) -> Array:
    """Largest motion of the tip, m, per rad or m of each joint, (n,)."""
    lengths = [float(np.linalg.norm(joint.placement.position)) for joint in arm.joints]
    spans = np.array([*lengths, float(np.linalg.norm(arm.tip.position))])
    for k, joint in enumerate(arm.joints):
        if joint.kind == "prismatic":
            spans[k + 1] += max(abs(joint.lower), abs(joint.upper))
    return np.array([
        1.0 if joint.kind == "prismatic" else float(spans[k + 1 :].sum())
        for k, joint in enumerate(arm.joints)
    ])  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Point:
    """A point fixed to links of an arm."""

    place: Array  # in the root frame with all joints at zero, m, (3,)
    first: int  # number of the first link that it is fixed to, the root being link 0
    last: int  # of the last; a point on a revolute axis is fixed to both links that meet there


@dataclass(frozen=True, eq=False)
class _Circle:
    """The circle of a point that turns about an axis; of radius 0 a point that stands still."""

    centre: Array
    axis: Array
    radius: float

    @classmethod
    def of(cls, point: Array, origin: Array, axis: Array) -> _Circle:
        """The circle of a point about an axis."""
        centre = origin + axis * (axis @ (point - origin))
        return cls(centre, axis, float(np.linalg.norm(point - centre)))

    def distances(self, point: Array) -> tuple[float, float]:
        """The least and the largest distance to a point."""
        away = point - self.centre
        height = away @ self.axis
        aside = float(np.linalg.norm(away - height * self.axis))
        return (
            float(np.hypot(height, aside - self.radius)),
            float(np.hypot(height, aside + self.radius)),
        )


class ReachBound:
    """Least and largest distances between points of an arm's axes within its joint limits.

    The points are where neighbouring axes meet or come nearest: shoulder, elbow, wrist. With one
    joint between two points the distances are a closed form; with more joints they follow from the
    triangle inequality over points in between.
    """

    def __init__(self, joints: tuple[Joint, ...], tip: Pose, lower: Array, upper: Array) -> None:
        """Compute the distances of a chain of joints with limits, (n,)."""
        self._joints = joints
        position, rotation = np.zeros(3), np.eye(3)
        origins, axes = [], []
        for joint in joints:
            position = position + rotation @ joint.placement.position
            rotation = rotation @ joint.placement.rotation
            origins.append(position)
            axes.append(rotation @ joint.axis)
        self._origins, self._axes = origins, axes
        self._tip, self._turn = position + rotation @ tip.position, rotation @ tip.rotation
        self._points = self._chosen()
        count = len(self._points)
        far, near = np.full((count, count), np.inf), np.zeros((count, count))
        for (i, a), (j, b) in itertools.product(enumerate(self._points), repeat=2):
            if a.first <= b.last and b.first <= a.last:
                far[i, j] = near[i, j] = np.linalg.norm(a.place - b.place)
            elif b.first == a.last + 1:
                k = a.last
                near[i, j], far[i, j] = self._across(k, a.place, b.place, lower[k], upper[k])
                near[j, i], far[j, i] = near[i, j], far[i, j]
        for row in range(count):
            far = np.minimum(far, far[:, row, None] + far[row])
        for row in range(count):
            near = np.maximum(near, near[:, row, None] - far[row])
            near = np.maximum(near, near[row] - far[:, row, None])
        self._far, self._near = far, near

    @staticmethod
    def of(arm: Arm, lower: Array, upper: Array) -> ReachBound:
        """The bounds of an arm with joint limits, (n,); cached."""
        return _kept(arm.joints, arm.tip, tuple(lower.tolist()), tuple(upper.tolist()))

    def missed(self, goal: Array, *, rigid: bool) -> float:
        """A lower bound of the distance, m, by which the tip misses a goal in the root frame, (7,);
        where the orientation counts, points on the last axis are known too.

        If it is positive no posture within limits reaches the goal.
        """
        n, bound = len(self._joints), -np.inf
        turn = np.array(rotation_rows(goal[3:]), dtype=float) @ self._turn.T

        def placed(point: Array) -> Array:
            return np.asarray(goal[:3] + turn @ (point - self._tip))

        held = []
        for j, point in enumerate(self._points):
            if point.last == n and (rigid or point.first == n):
                held.append((j, _Circle(placed(point.place), np.zeros(3), 0.0)))
            elif rigid and point.last == n - 1 and self._joints[-1].kind == "revolute":
                origin, axis = placed(self._origins[-1]), turn @ self._axes[-1]
                held.append((j, _Circle.of(placed(point.place), origin, axis)))
        for i, point in enumerate(self._points):
            if point.first > 1 or (point.first == 1 and self._joints[0].kind != "revolute"):
                continue
            for j, circle in held:
                if point.first == 0:
                    least, largest = circle.distances(point.place)
                elif circle.radius == 0.0:
                    about = _Circle.of(point.place, self._origins[0], self._axes[0])
                    least, largest = about.distances(circle.centre)
                else:
                    continue
                bound = max(bound, least - self._far[i, j], self._near[i, j] - largest)
        return float(bound)

    def _chosen(self) -> list[_Point]:
        """Points of revolute axes that are nearest to their neighbours, ends of slides, the tip."""
        points: list[_Point] = []
        same_point = 1e-9  # points nearer to each other are one, m
        parallel = 1e-6  # axes are parallel if the sine of their angle is smaller

        def add(place: Array, first: int, last: int) -> None:
            for known in points:
                same = (known.first, known.last) == (first, last)
                if same and np.linalg.norm(known.place - place) < same_point:
                    return
            points.append(_Point(place, first, last))

        n = len(self._joints)
        for k, (origin, axis) in enumerate(zip(self._origins, self._axes, strict=True)):
            if self._joints[k].kind == "prismatic":
                add(origin, k, k)
                add(origin, k + 1, k + 1)
                continue
            add(origin, k, k + 1)
            for next_to in (k - 1, k + 1):
                if next_to < 0:
                    continue
                other = self._tip if next_to == n else self._origins[next_to]
                add(origin + axis * (axis @ (other - origin)), k, k + 1)
                if next_to == n or self._joints[next_to].kind == "prismatic":
                    continue
                across = np.cross(axis, self._axes[next_to])
                if np.linalg.norm(across) > parallel:
                    basis = np.column_stack([axis, -self._axes[next_to], across])
                    along = np.linalg.solve(basis, other - origin)[0]
                    add(origin + along * axis, k, k + 1)
        add(self._tip, n, n)
        return points

    def _across(
        self, k: int, a: Array, b: Array, lower: float, upper: float
    ) -> tuple[float, float]:
        """The least and the largest distance between a point before joint k and one beyond it."""
        origin, axis = self._origins[k], self._axes[k]
        if self._joints[k].kind == "prismatic":
            along = float((b - a) @ axis)
            aside = float(np.linalg.norm(b - a - along * axis))
            low, high = along + lower, along + upper
            least, largest = min(max(0.0, low), high), max(abs(low), abs(high))
            return float(np.hypot(aside, least)), float(np.hypot(aside, largest))
        one, other = a - origin, b - origin
        height = float((one - other) @ axis)
        one, other = one - axis * (one @ axis), other - axis * (other @ axis)
        angle = float(np.arctan2(axis @ np.cross(one, other), one @ other))
        squares = height**2 + float(one @ one + other @ other)
        product = 2 * float(np.linalg.norm(one) * np.linalg.norm(other))
        low, high = angle + lower, angle + upper
        nearest = squares - product * _largest_cosine(low, high)
        farthest = squares + product * _largest_cosine(low - np.pi, high - np.pi)
        return float(np.sqrt(max(nearest, 0.0))), float(np.sqrt(farthest))


@lru_cache(maxsize=256)
def _kept(
    joints: tuple[Joint, ...], tip: Pose, lower: tuple[float, ...], upper: tuple[float, ...]
) -> ReachBound:
    """The cached bounds of a chain."""
    return ReachBound(joints, tip, np.array(lower), np.array(upper))


def _largest_cosine(low: float, high: float) -> float:
    """The largest cosine of the angles from low to high, rad."""
    if not high - low < 2 * np.pi or np.ceil(low / (2 * np.pi)) <= np.floor(high / (2 * np.pi)):
        return 1.0
    return float(max(np.cos(low), np.cos(high)))


def out_of_reach(arm: Arm, lower: Array, upper: Array, goal: Array, *, rigid: bool) -> bool:
    """Proof that links are too short, or too long, for a goal; see `ReachBound.missed`."""
    rounding = 1e-9  # of a distance, m
    return ReachBound.of(arm, lower, upper).missed(goal, rigid=rigid) > rounding
