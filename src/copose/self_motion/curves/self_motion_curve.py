"""The self-motion of an arm with one degree of freedom to spare, with values along it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array, Mask
from copose.self_motion.curves.arc_length import Track, snapped
from copose.self_motion.curves.joint_range import Cut, JointRange
from copose.self_motion.curves.limited_curve import ArcKnotOptions
from copose.self_motion.projection import CLOSED, project


@dataclass(frozen=True, eq=False)
class SelfMotionCurve:
    """Postures that an arm reaches on one self-motion while the object stands still, by arc length.

    Lengths are those of joint space, rad (or m). The curve goes on beyond joint limits where it
    can. It starts in the middle of its longest part beyond limits. Neither its start nor its
    direction depends on the posture from which it was traced.
    """

    arm: str
    joint_names: tuple[str, ...]  # from root to tip
    branch: int  # number among all self-motions at this pose that limits leave something of
    # The curve and its knots, k of them, about evenly spaced: where limits cut it there is one. Of
    # a loop the last is the first again.
    track: Track
    limits: JointRange  # of the joints
    cuts: tuple[Cut, ...]  # crossings of joint limits, in order
    pieces: tuple[tuple[float, float], ...]  # intervals of arc length within limits
    # Arc length at the posture of the arm; None of a self-motion that it is not on.
    present: float | None
    value: float | None  # of the objective at that posture
    # With the other arms where they are, (k,); NaN where there is none, and outside of the `window`
    # where linear programs decide.
    objective: Array
    estimated: bool  # whether that is estimated, or taken between fewer postures
    clear: Mask  # where nothing comes too near, (k,); within limits alone it is asked
    held: Mask  # where torques hold the object at rest, if they have to, (k,), alike
    unit: str  # of the objective
    others: tuple[SelfMotionCurve, ...] = ()  # the arm's other self-motions at this pose

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
        """True if it comes back to its start, limits aside."""
        return self.track.loop

    @property
    def length(self) -> float:
        """Arc length from end to end, rad (or m)."""
        return self.track.length

    @property
    def unit_of_length(self) -> str:
        """Unit of arc lengths: ``rad``, with joints that slide ``rad, m``."""
        return "rad" if bool(self.limits.revolute.all()) else "rad, m"

    @property
    def inside(self) -> Mask:
        """Mask of the knots within limits, (k,)."""
        return self.within(self.positions)

    @property
    def allowed(self) -> Mask:
        """Mask of the knots within limits that keep clear, hold, and have an objective, (k,)."""
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
        """The interval of arc length to be shown: the pieces within limits and a margin."""
        ends = [end for piece in self.pieces for end in piece]
        if self.present is not None:
            ends.append(self.present)
        if not ends:
            return 0.0, self.length
        low, high = min(ends), max(ends)
        margin = 0.08 * (high - low) + ArcKnotOptions.spacing
        return max(0.0, low - margin), min(self.length, high + margin)

    def within(self, s: Array) -> Mask:
        """Mask of arc lengths within limits, (count,)."""
        s, end = np.asarray(s), self._rounding
        inside = np.zeros(len(s), dtype=bool)
        for low, high in self.pieces:
            inside |= (s >= low - end) & (s <= high + end)
        return inside

    def piece(self, s: float) -> tuple[float, float] | None:
        """The interval within limits that an arc length is in; None beyond limits."""
        s, end = self.track.kept(s), self._rounding
        return next((p for p in self.pieces if p[0] - end <= s <= p[1] + end), None)

    @property
    def _rounding(self) -> float:
        """Distance beyond the end of a piece that counts as within, rad (or m)."""
        return 1e-6

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
        manifold = self.track.manifold
        ends, gaps = project(
            manifold.kernels, q, manifold.goals[0], lower, upper, steps=9, closed=1e-13
        )
        lost = gaps > CLOSED
        if lost.any():
            open_ = np.full(q.shape[1], free)
            ends[lost] = project(manifold.kernels, q[lost], manifold.goals[0], -open_, open_)[0]
        return ends

    def spaced(self, low: float, high: float, count: int) -> Array:
        """Arc lengths of an interval, about evenly spaced, with all cuts and the present one."""
        marks = [cut.position for cut in self.cuts]
        return snapped(np.linspace(low, high, count), marks if self.present is None
                       else [self.present, *marks])  # fmt: skip
