"""Curves of closed postures by their arc length in the space of joint positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from copose.poses import Array
from copose.self_motion.curves.curve import Curve
from copose.self_motion.manifold import ClosureManifold
from copose.self_motion.projection import CLOSED, project


@dataclass(frozen=True, eq=False)
class Track:
    """A curve of closed postures, without regard to limits of revolute joints.

    It goes the way in which det [J; tᵀ], J the geometric Jacobian and t the tangent, is positive.
    """

    positions: Array  # arc length at its knots, rad (or m), from 0 on, (k,)
    points: Array  # postures at the knots, without jumps by whole turns, (k, n)
    tangents: Array  # of unit length, there, (k, n)
    loop: bool  # whether the last knot is the first again, whole turns apart
    manifold: ClosureManifold  # of the arm, (1, n)

    @classmethod
    def of(cls, curve: Curve, rigid: bool) -> Track:
        """A traced curve by its arc length."""
        points, tangents = curve.points, curve.tangents
        if curve.loop:
            points, tangents = (np.vstack([x, x[:1]]) for x in (points, tangents))
        kernels, goal = curve.manifold.kernels, curve.manifold.goals[0]
        _, J = kernels.residual(points[:1], goal)
        # The error of angles is that of a quaternion, which is another after a turn of a joint.
        side = np.sign(kernels.gap(points[:1], goal)[0, 3]) if rigid else 1.0
        if side * np.linalg.det(np.vstack([J[0], tangents[:1]])) < 0:
            points, tangents = points[::-1], -tangents[::-1]
        ahead = curve.manifold.many(max(1, len(points) - 1)).wrapped(np.diff(points, axis=0))
        points = points[0] + np.vstack([0 * points[:1], np.cumsum(ahead, axis=0)])
        arcs = np.concatenate([[0.0], np.cumsum(_arcs(ahead, tangents[:-1], tangents[1:]))])
        return cls(arcs, points, tangents, curve.loop, curve.manifold)

    @property
    def length(self) -> float:
        """Arc length from end to end, rad (or m)."""
        return float(self.positions[-1])

    @cached_property
    def _turns(self) -> Array:
        """Whole turns of the joints in one round of a loop, rad, (n,)."""
        return np.asarray(self.points[-1] - self.points[0])

    def cubic(self, s: Array) -> tuple[Array, Array]:
        """Cubics at arc lengths: postures near the curve, (count, n), and their derivatives."""
        rounds = np.floor(s / self.length) if self.loop and self.length > 0 else np.zeros(len(s))
        s = s - rounds * self.length
        last = len(self.positions) - 2
        k = np.clip(np.searchsorted(self.positions, s, side="right") - 1, 0, max(last, 0))
        if last < 0:
            return self.points[k], self.tangents[k]
        width = (self.positions[k + 1] - self.positions[k])[:, None]
        u = (s - self.positions[k])[:, None] / width
        a, b = self.points[k], self.points[k + 1]
        da, db = self.tangents[k] * width, self.tangents[k + 1] * width
        bend, turn = 3 * (b - a) - 2 * da - db, 2 * (a - b) + da + db
        q = a + u * (da + u * (bend + u * turn)) + rounds[:, None] * self._turns
        return q, (da + u * (2 * bend + 3 * u * turn)) / width

    def closed(self, s: Array) -> Array:
        """Postures at arc lengths, (count, n), projected onto the closure."""
        free = np.full(self.points.shape[1], np.inf)
        q = self.cubic(s)[0]
        return project(
            self.manifold.kernels, q, self.manifold.goals[0], -free, free, steps=6, closed=1e-12
        )[0]

    def resampled(self, s: Array) -> Track:
        """The curve with knots at other arc lengths; of a loop the last is the first once round."""
        points, heading = self.closed(s), self.cubic(s)[1]
        heading /= np.linalg.norm(heading, axis=1, keepdims=True)
        still = np.zeros(len(s)), np.zeros_like(points)
        tangents = self.manifold.many(len(s)).step(points, heading, *still, CLOSED).tangent
        lost = ~np.isfinite(tangents).all(axis=1)
        tangents[lost] = heading[lost]
        return Track(s - s[0], points, tangents, self.loop, self.manifold)

    def place(self, q: Array) -> float:
        """The arc length at a posture on the curve, (n,)."""
        many = self.manifold.many(len(self.points))
        offset = many.wrapped(q - self.points)
        k = int((offset**2).sum(axis=1).argmin())
        s = float(self.positions[k] + offset[k] @ self.tangents[k])
        for _ in range(3):
            s = self.kept(s)
            point, tangent = self.closed(np.array([s])), self.cubic(np.array([s]))[1]
            s += float(self.manifold.wrapped(q - point)[0] @ tangent[0])
        return self.kept(s)

    def kept(self, s: float) -> float:
        """The arc length moved onto the curve: into one round of a loop, or between the ends."""
        if not self.loop:
            return float(np.clip(s, 0.0, self.length))
        return float(s % self.length) if self.length > 0 else 0.0


def _arcs(ahead: Array, before: Array, after: Array) -> Array:
    """Lengths of cubics with these chords and unit tangents at their ends, (k, n) each: (k,)."""
    chord = np.linalg.norm(ahead, axis=1)
    length = chord
    for _ in range(3):  # fixed-point iterations
        middle = np.linalg.norm(1.5 * ahead - length[:, None] / 4 * (before + after), axis=1)
        length = (2 * length + 4 * middle) / 6
    return np.asarray(length)


def snapped(s: Array, marks: Sequence[float]) -> Array:
    """Arc lengths in order, the nearest to each mark, but for the ends, moved onto it."""
    same = 1e-6  # distance of marks and arc lengths that are one, rad (or m)
    s, apart = s.copy(), s.copy()
    apart[[0, -1]] = np.inf
    for mark in marks:
        k = int(np.abs(apart - mark).argmin())
        # Two marks may be nearest to the same, or one at an end.
        if np.isfinite(apart[k]) and np.abs(s - mark).min() > same:
            s[k], apart[k] = mark, np.inf
    return np.sort(s)
