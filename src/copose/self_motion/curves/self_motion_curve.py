"""The self-motion of an arm with one degree of freedom to spare, to be moved along by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.poses import Array, Mask
from copose.self_motion.curves.arc_length import Track
from copose.self_motion.curves.joint_range import Cut, JointRange
from copose.self_motion.projection import CLOSED, project

# Between knots of a curve, rad (or m).
SPACING = 0.06
# Of what is allowed, that is shown beyond it at both ends.
_MARGIN = 0.08
# What an arc length may be beyond an end of what is allowed, rad (or m).
_AT_END = 1e-6
_STEPS = 9
_EXACT = 1e-13


@dataclass(frozen=True, eq=False)
class SelfMotionCurve:
    """All postures that an arm comes to while the object stands still, by arc length.

    Lengths are those of joint space, rad (or m). The curve goes on beyond joint limits where it
    can. It starts in the middle of its longest part beyond limits, and goes a way that no posture
    on it decides: so it is the same curve from whatever posture on it one asks.

    Attributes:
        arm: its name.
        joint_names: from root to tip.
        branch: number among all self-motions at this pose that limits leave something of.
        track: the curve and its knots, k of them, about evenly spaced: where limits cut it there
            is one. Of a loop the last is the first again.
        limits: of the joints.
        cuts: where limits cut it, in order.
        pieces: from where to where it is within limits.
        present: arc length at the posture of the arm; None of a self-motion that it is not on.
        value: of the objective at that posture.
        objective: with the other arms where they are, (k,); NaN where there is none, and outside
            of the `window` where linear programs decide.
        estimated: whether that is estimated, or taken between fewer postures.
        clear: where nothing comes too near, (k,); within limits alone it is asked.
        held: where torques hold the object at rest, if they have to, (k,), alike.
        unit: of the objective.
        others: the arm's other self-motions at this pose.
    """

    arm: str
    joint_names: tuple[str, ...]
    branch: int
    track: Track
    limits: JointRange
    cuts: tuple[Cut, ...]
    pieces: tuple[tuple[float, float], ...]
    present: float | None
    value: float | None
    objective: Array
    estimated: bool
    clear: Mask
    held: Mask
    unit: str
    others: tuple[SelfMotionCurve, ...] = ()

    @property
    def positions(self) -> Array:
        """Arc lengths at the knots, (k,), from 0 to `length`."""
        return self.track.positions

    @property
    def points(self) -> Array:
        """Postures at the knots, (k, n), without jumps by whole turns."""
        return self.track.points

    @property
    def loop(self) -> bool:
        """Whether it comes back to where it started, limits aside."""
        return self.track.loop

    @property
    def length(self) -> float:
        """From end to end, rad (or m)."""
        return self.track.length

    @property
    def unit_of_length(self) -> str:
        """Of arc lengths: ``rad``, with joints that slide ``rad, m``."""
        return "rad" if bool(self.limits.revolute.all()) else "rad, m"

    @property
    def inside(self) -> Mask:
        """Which knots are within limits, (k,)."""
        return self.within(self.positions)

    @property
    def allowed(self) -> Mask:
        """Which knots are within limits, keep clear, hold, and are worth something, (k,)."""
        return self.inside & self.clear & self.held & np.isfinite(self.objective)

    @property
    def best(self) -> tuple[float, float] | None:
        """Arc length and value of the best allowed knot, or of the present posture if that is no
        worse; None where none is allowed.
        """
        if not self.allowed.any():
            return None
        k = int(np.where(self.allowed, self.objective, -np.inf).argmax())
        s, value = float(self.positions[k]), float(self.objective[k])
        if self.present is not None and self.value is not None and self.value >= value:
            return self.present, self.value
        return s, value

    @property
    def window(self) -> tuple[float, float]:
        """From where to where it is worth showing: what limits leave, and a little more."""
        ends = [end for piece in self.pieces for end in piece]
        if self.present is not None:
            ends.append(self.present)
        if not ends:
            return 0.0, self.length
        low, high = min(ends), max(ends)
        more = _MARGIN * (high - low) + SPACING
        return max(0.0, low - more), min(self.length, high + more)

    def within(self, s: Array) -> Mask:
        """Which arc lengths, (count,), are within limits."""
        s = np.asarray(s)
        found = np.zeros(len(s), dtype=bool)
        for low, high in self.pieces:
            found |= (s >= low - _AT_END) & (s <= high + _AT_END)
        return found

    def piece(self, s: float) -> tuple[float, float] | None:
        """From where to where the arm can move within limits from an arc length; None beyond."""
        s = self.track.kept(s)
        return next((p for p in self.pieces if p[0] - _AT_END <= s <= p[1] + _AT_END), None)

    def at(self, s: float) -> Array:
        """The posture at an arc length, (n,), see `postures`."""
        return np.asarray(self.postures(np.array([s]))[0])

    def postures(self, s: Array) -> Array:
        """Postures at some arc lengths, (count, n), closed to 1e-9.

        Round a loop they repeat. Within limits so are they, to the last digit, and within a piece
        they have no jumps; elsewhere there may be some, by whole turns.
        """
        s = np.array([self.track.kept(x) for x in np.asarray(s, dtype=float)])
        q = self.limits.turned(self.track.cubic(s)[0])
        within, free = self.within(s)[:, None], np.inf
        lower = np.where(within, self.limits.lower, -free)
        upper = np.where(within, self.limits.upper, free)
        rails = self.track.rails
        ends, gaps = project(
            rails.kernels, q, rails.goals[0], lower, upper, steps=_STEPS, closed=_EXACT
        )
        lost = gaps > CLOSED
        if lost.any():
            open_ = np.full(q.shape[1], free)
            ends[lost] = project(rails.kernels, q[lost], rails.goals[0], -open_, open_)[0]
        return ends

    def spaced(self, low: float, high: float, count: int) -> Array:
        """Arc lengths from one to another, about evenly, with those where limits cut it, and the
        present one.
        """
        marks = [cut.position for cut in self.cuts]
        return snapped(np.linspace(low, high, count), marks if self.present is None
                       else [self.present, *marks])  # fmt: skip


def snapped(s: Array, marks: Sequence[float]) -> Array:
    """Arc lengths in order, the nearest to each mark, but for the ends, moved there."""
    s, apart = s.copy(), s.copy()
    apart[[0, -1]] = np.inf
    for mark in marks:
        k = int(np.abs(apart - mark).argmin())
        # Two marks may be nearest to the same, or one at an end.
        if np.isfinite(apart[k]) and np.abs(s - mark).min() > _AT_END:
            s[k], apart[k] = mark, np.inf
    return np.sort(s)
