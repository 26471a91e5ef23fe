"""Whether a tip is where no posture of its arm can bring it: bounds that hold, not searches."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from copose.poses import Array, Pose, rotation_rows
from copose.robots import Arm, Joint, finite_range
from copose.self_motion.kernels import ArmKernels

# Boxes of joint positions that are looked at before a proof is given up.
_BOXES = 120_000
# Of them so many that none is ruled out among tell that the ranges are too wide for a proof.
_UNDECIDED = 2_000
# What rounding may make of a distance, m or rad.
_ROUNDING = 1e-9
# Points nearer than this are one, m; and axes whose angle's sine is smaller are parallel.
_SAME, _PARALLEL = 1e-9, 1e-6


def levers(arm: Arm) -> Array:
    """How far the tip comes at most for a rad or m of each joint, (n,)."""
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
    """A point of the arm at zero, root axes, (3,), and the first and the last link that it is
    fixed to: a point of a revolute axis to both links that meet there, the root being link 0.
    """

    place: Array
    first: int
    last: int


@dataclass(frozen=True, eq=False)
class _Circle:
    """What a point describes about an axis; of radius 0 a point that does not move."""

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
    """How far apart points of an arm's axes are at most and at least, within its joint limits.

    With one joint between two points that is a closed form; with more of them a sum over points in
    between. The points are where neighbouring axes meet or come nearest: shoulder, elbow, wrist.
    """

    def __init__(self, joints: tuple[Joint, ...], tip: Pose, lower: Array, upper: Array) -> None:
        """The distances of a chain of joints with limits, (n,)."""
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
        """The distances of an arm with limits, (n,); they are kept."""
        return _kept(arm.joints, arm.tip, tuple(lower.tolist()), tuple(upper.tolist()))

    def missed(self, goal: Array, *, rigid: bool) -> float:
        """By how much the tip misses its goal at least, m; above zero no posture comes there.

        Args:
            goal: of the tip in the root frame, position and quaternion, (7,).
            rigid: whether its orientation is asked for: axes near the tip are then known too.
        """
        n, most = len(self._joints), -np.inf
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
                most = max(most, least - self._far[i, j], self._near[i, j] - largest)
        return float(most)

    def _chosen(self) -> list[_Point]:
        """Points of revolute axes that are nearest to their neighbours, ends of slides, the tip."""
        points: list[_Point] = []

        def add(place: Array, first: int, last: int) -> None:
            for known in points:
                same = (known.first, known.last) == (first, last)
                if same and np.linalg.norm(known.place - place) < _SAME:
                    return
            points.append(_Point(place, first, last))

        n = len(self._joints)
        for k, (origin, axis) in enumerate(zip(self._origins, self._axes, strict=True)):
            if self._joints[k].kind == "prismatic":
                add(origin, k, k)
                add(origin, k + 1, k + 1)
                continue
            add(origin, k, k + 1)
            for beside in (k - 1, k + 1):
                if beside < 0:
                    continue
                other = self._tip if beside == n else self._origins[beside]
                add(origin + axis * (axis @ (other - origin)), k, k + 1)
                if beside == n or self._joints[beside].kind == "prismatic":
                    continue
                across = np.cross(axis, self._axes[beside])
                if np.linalg.norm(across) > _PARALLEL:
                    basis = np.column_stack([axis, -self._axes[beside], across])
                    along = np.linalg.solve(basis, other - origin)[0]
                    add(origin + along * axis, k, k + 1)
        add(self._tip, n, n)
        return points

    def _across(
        self, k: int, a: Array, b: Array, lower: float, upper: float
    ) -> tuple[float, float]:
        """The least and the largest distance of a point before joint k to one beyond it."""
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
    return ReachBound(joints, tip, np.array(lower), np.array(upper))


def _largest_cosine(low: float, high: float) -> float:
    """Of angles from low to high."""
    if not high - low < 2 * np.pi or np.ceil(low / (2 * np.pi)) <= np.floor(high / (2 * np.pi)):
        return 1.0
    return float(max(np.cos(low), np.cos(high)))


def out_of_reach(arm: Arm, lower: Array, upper: Array, goal: Array, *, rigid: bool) -> bool:
    """Whether links are too short, or too long, for a goal; see `ReachBound.missed`."""
    return ReachBound.of(arm, lower, upper).missed(goal, rigid=rigid) > _ROUNDING


def excluded(
    arm: Arm, kernels: ArmKernels, lower: Array, upper: Array, goal: Array, *, rigid: bool
) -> bool:
    """Whether no posture within limits brings the tip to a goal: boxes of joint positions are cut
    in halves until in each the middle is farther off than the joints can make good.

    Args:
        arm: it.
        kernels: its own.
        lower: limits of its joints, (n,).
        upper: alike.
        goal: see `ReachBound.missed`.
        rigid: whether its orientation is asked for.
    """
    if out_of_reach(arm, lower, upper, goal, rigid=rigid):
        return True
    low, high = finite_range(lower, upper)
    reach = levers(arm)
    turning = np.array([joint.kind == "revolute" for joint in arm.joints], dtype=float)
    if not np.all(np.isfinite(reach)) or not np.all(np.isfinite([low, high])):
        return False
    middle, half = (low + high)[None] / 2, (high - low)[None] / 2
    seen = 0
    while len(middle):
        seen += len(middle)
        if seen + 2 * len(middle) > _BOXES:
            return False
        off = kernels.gap(middle, goal)
        near = np.linalg.norm(off[:, :3], axis=1) <= half @ reach + _ROUNDING
        if rigid:
            near &= 2 * np.linalg.norm(off[:, 4:], axis=1) <= half @ turning + _ROUNDING
        if len(middle) > _UNDECIDED and near.all():
            return False
        middle, half = middle[near], half[near]
        widest = (half * (reach + turning * rigid)).argmax(axis=1)
        rows = np.arange(len(half))
        half = half.copy()
        half[rows, widest] /= 2
        step = np.zeros_like(half)
        step[rows, widest] = half[rows, widest]
        middle, half = np.vstack([middle - step, middle + step]), np.vstack([half, half])
    return True
