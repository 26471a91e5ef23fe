"""Where self-motions start and what limits leave of them, whatever they are worth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array
from copose.self_motion.curves.arc_length import Track
from copose.self_motion.curves.joint_range import Cut, JointRange, allowed_pieces, limit_cuts
from copose.self_motion.curves.self_motion_curve import SPACING, snapped

# Knots of a curve, at least and at most.
_FEWEST = 48
_MOST = 480
# Places between knots at which a function of the posture is asked where it is least.
_BETWEEN = 4


@dataclass(frozen=True, eq=False)
class Course:
    """A self-motion by arc length from a start that no posture on it decides, and its limits.

    Attributes:
        track: from where the curve starts.
        cuts: where limits cut it.
        pieces: from where to where it is within limits.
    """

    track: Track
    cuts: tuple[Cut, ...]
    pieces: tuple[tuple[float, float], ...]

    @classmethod
    def of(cls, track: Track, limits: JointRange) -> Course:
        """That along a curve, from a start that no posture on it decides."""
        count = int(np.clip(track.length / SPACING, _FEWEST, _MOST)) + 1
        cuts = limit_cuts(track, limits)
        first = _start(track, cuts) if track.loop else 0.0
        cuts = tuple(sorted(
            (Cut((cut.position - first) % track.length if track.loop else cut.position,
                 cut.joint, cut.upper, cut.entering) for cut in cuts),
            key=lambda cut: cut.position,
        ))  # fmt: skip
        s = snapped(np.linspace(0.0, track.length, count), [cut.position for cut in cuts])
        track = track.resampled(first + s)
        track = Track(s, _anchored(track.points, limits), track.tangents,
                      track.loop, track.rails)  # fmt: skip
        within = not cuts[0].entering if cuts else bool(limits.inside(track.points[:1])[0])
        return cls(track, cuts, allowed_pieces(track.length, cuts, within))

    @property
    def mark(self) -> tuple[float, ...]:
        """What self-motions are put in order by: where the middle of what limits leave is."""
        low, high = max(self.pieces, key=lambda p: p[1] - p[0], default=(0.0, self.track.length))
        middle = self.track.cubic(np.array([(low + high) / 2]))[0][0]
        turns = np.where(self.track.rails.unlimited[0], np.round(middle / (2 * np.pi)), 0.0)
        return tuple((middle - 2 * np.pi * turns).round(3))

    def holding(self, q: Array) -> tuple[Course, float]:
        """The same with whole turns as a posture on it, (n,), has them, and its arc length."""
        s = self.track.place(q)
        turns = 2 * np.pi * np.round((q - self.track.closed(np.array([s]))[0]) / (2 * np.pi))
        turns = np.where(self.track.rails.unlimited[0], turns, 0.0)
        old = self.track
        moved = Track(old.positions, old.points + turns, old.tangents, old.loop, old.rails)
        return Course(moved, self.cuts, self.pieces), s


def _start(track: Track, cuts: tuple[Cut, ...]) -> float:
    """Where a loop starts: midway in the longest part beyond limits; without one where a certain
    smooth function of the posture is least.
    """
    leaving = [cut.position for cut in cuts if not cut.entering]
    entering = np.array([cut.position for cut in cuts if cut.entering])
    if leaving and len(entering):
        gaps = [float(((entering - s) % track.length).min()) for s in leaving]
        k = int(np.argmax(gaps))
        return (leaving[k] + gaps[k] / 2) % track.length
    weights = 1 / (1 + np.arange(track.points.shape[1]))
    s = np.linspace(0.0, track.length, _BETWEEN * len(track.positions), endpoint=False)
    f = np.cos(track.cubic(s)[0]) @ weights
    k = int(f.argmin())
    a, b, c = f[k - 1], f[k], f[(k + 1) % len(f)]
    bend = a - 2 * b + c
    return float(s[k] + (0.5 * (a - c) / bend if bend > 0 else 0.0) * s[1]) % track.length


def _anchored(points: Array, limits: JointRange) -> Array:
    """Postures along a curve, (k, n), moved together by whole turns, so that the middle one of
    those within limits is there.
    """
    inside = np.flatnonzero(limits.inside(points))
    middle = points[inside[len(inside) // 2] if len(inside) else 0][None]
    # Joints beyond a whole turn from zero come back first.
    near = np.where(limits.revolute, middle - 2 * np.pi * np.round(middle / (2 * np.pi)), middle)
    return np.asarray(points + (limits.turned(near) - middle))
