"""Self-motions by arc length from canonical starts, with the pieces that joint limits leave."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array
from copose.self_motion.curves.arc_length import Track, snapped
from copose.self_motion.curves.joint_range import Cut, JointRange, allowed_pieces, limit_cuts


@dataclass(frozen=True)
class ArcKnotOptions:
    """Knots of a self-motion by arc length."""

    spacing: float = 0.06  # rad (or m)
    fewest: int = 48
    most: int = 480
    between: int = 4  # values for every knot of the function whose minimum starts a loop


@dataclass(frozen=True, eq=False)
class LimitedCurve:
    """A self-motion by arc length and its limits.

    Its start depends on the curve alone, not on the posture from which it was traced.
    """

    track: Track  # the curve from its start
    cuts: tuple[Cut, ...]  # crossings of joint limits
    pieces: tuple[tuple[float, float], ...]  # intervals of arc length within limits

    @classmethod
    def of(
        cls, track: Track, limits: JointRange, options: ArcKnotOptions = ArcKnotOptions()
    ) -> LimitedCurve:
        """The self-motion along a curve, with new knots."""
        count = int(np.clip(track.length / options.spacing, options.fewest, options.most)) + 1
        cuts = limit_cuts(track, limits)
        first = _start(track, cuts, options.between) if track.loop else 0.0
        cuts = tuple(sorted(
            (Cut((cut.position - first) % track.length if track.loop else cut.position,
                 cut.joint, cut.upper, cut.entering) for cut in cuts),
            key=lambda cut: cut.position,
        ))  # fmt: skip
        s = snapped(np.linspace(0.0, track.length, count), [cut.position for cut in cuts])
        track = track.resampled(first + s)
        track = Track(s, _anchored(track.points, limits), track.tangents,
                      track.loop, track.manifold)  # fmt: skip
        within = not cuts[0].entering if cuts else bool(limits.inside(track.points[:1])[0])
        return cls(track, cuts, allowed_pieces(track.length, cuts, within))

    @property
    def mark(self) -> tuple[float, ...]:
        """A key that orders self-motions: the posture in the middle of the longest piece."""
        low, high = max(self.pieces, key=lambda p: p[1] - p[0], default=(0.0, self.track.length))
        middle = self.track.cubic(np.array([(low + high) / 2]))[0][0]
        turns = np.where(self.track.manifold.unlimited[0], np.round(middle / (2 * np.pi)), 0.0)
        return tuple((middle - 2 * np.pi * turns).round(3))

    def holding(self, q: Array) -> tuple[LimitedCurve, float]:
        """The self-motion in the turns of a posture on it, (n,), and the arc length there."""
        s = self.track.place(q)
        turns = 2 * np.pi * np.round((q - self.track.closed(np.array([s]))[0]) / (2 * np.pi))
        turns = np.where(self.track.manifold.unlimited[0], turns, 0.0)
        old = self.track
        moved = Track(old.positions, old.points + turns, old.tangents, old.loop, old.manifold)
        return LimitedCurve(moved, self.cuts, self.pieces), s


def _start(track: Track, cuts: tuple[Cut, ...], between: int) -> float:
    """The arc length of a loop's start: the middle of its longest part beyond limits.

    Without one it is the minimum of Σ cos(q_k)/(k + 1), of which `between` values are taken for
    every knot.
    """
    leaving = [cut.position for cut in cuts if not cut.entering]
    entering = np.array([cut.position for cut in cuts if cut.entering])
    if leaving and len(entering):
        gaps = [float(((entering - s) % track.length).min()) for s in leaving]
        k = int(np.argmax(gaps))
        return (leaving[k] + gaps[k] / 2) % track.length
    weights = 1 / (1 + np.arange(track.points.shape[1]))
    s = np.linspace(0.0, track.length, between * len(track.positions), endpoint=False)
    f = np.cos(track.cubic(s)[0]) @ weights
    k = int(f.argmin())
    a, b, c = f[k - 1], f[k], f[(k + 1) % len(f)]
    bend = a - 2 * b + c
    return float(s[k] + (0.5 * (a - c) / bend if bend > 0 else 0.0) * s[1]) % track.length


def _anchored(points: Array, limits: JointRange) -> Array:
    """Postures along a curve, (k, n), moved by the same whole turns.

    The middle one of those within limits, whole turns apart, is then within limits as it is.
    """
    inside = np.flatnonzero(limits.inside(points))
    middle = points[inside[len(inside) // 2] if len(inside) else 0][None]
    # Joints beyond a whole turn from zero come back first.
    near = np.where(limits.revolute, middle - 2 * np.pi * np.round(middle / (2 * np.pi)), middle)
    return np.asarray(points + (limits.turned(near) - middle))
