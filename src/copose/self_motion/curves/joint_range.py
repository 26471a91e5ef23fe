"""Joint limits along a curve of postures: crossings, and the pieces within limits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from copose.cell.cell import Cell
from copose.poses import Array, Mask
from copose.self_motion.curves.arc_length import Track


@dataclass(frozen=True)
class LimitCutOptions:
    """The search for crossings of joint limits along a curve."""

    between: int = 8  # postures per knot at which limits are asked
    halvings: int = 40  # that find a crossing of the cubic between knots
    corrections: int = 2  # Newton steps to the crossing of the curve itself
    at_end: float = 1e-6  # distance of a sliding joint from the limit that ends its curve, m
    slowest: float = 1e-3  # approach to a limit that a Newton step divides by, rad per rad


@dataclass(frozen=True, eq=False)
class JointRange:
    """Limits of an arm's joints, whole turns of revolute joints apart."""

    lower: Array  # lowest positions, margin kept, −∞ where there is none, (n,)
    upper: Array  # highest, alike
    revolute: Mask  # which joints turn, (n,)
    rounding: float = 1e-9  # distance beyond a limit that counts as within, rad (or m)

    @classmethod
    def of(cls, cell: Cell, i: int) -> JointRange:
        """The limits of arm i."""
        revolute = np.array([joint.kind == "revolute" for joint in cell.arms[i].joints], dtype=bool)
        return cls(cell.lower[i], cell.upper[i], revolute)

    @property
    def freed(self) -> tuple[Array, Array]:
        """Lower and upper limits of sliding joints alone, (n,) each: others come back in a turn."""
        return (
            np.where(self.revolute, -np.inf, self.lower),
            np.where(self.revolute, np.inf, self.upper),
        )

    @cached_property
    def middle(self) -> Array:
        """Middle of the limits, 0 where there are none, (n,)."""
        low, high = (np.where(self._limited, x, 0.0) for x in (self.lower, self.upper))
        return np.asarray((low + high) / 2)

    @cached_property
    def half(self) -> Array:
        """Half the distance of the limits, infinite where there are none, (n,)."""
        return np.where(self._limited, self.upper - self.lower, np.inf) / 2

    def excess(self, q: Array) -> Array:
        """Distance of each joint beyond its limits, negative within, at postures: (count, n)."""
        return np.asarray(np.abs(self.offset(q)) - self.half)

    def offset(self, q: Array) -> Array:
        """Joints of postures from the middle of their limits, by less than a turn, (count, n)."""
        turn, offset = 2 * np.pi, q - self.middle
        return np.where(self.revolute, offset - turn * np.round(offset / turn), offset)

    @property
    def _limited(self) -> Mask:
        """Mask of the joints with limits, (n,)."""
        return np.isfinite(self.lower) & np.isfinite(self.upper)

    def inside(self, q: Array) -> Mask:
        """Mask of the postures, (count, n), within limits, whole turns apart: (count,)."""
        return np.asarray(self.excess(q).max(axis=1) <= self.rounding)

    def turned(self, q: Array) -> Array:
        """Postures, (count, n), with joints moved by whole turns into limits where possible."""
        turn, rounding = 2 * np.pi, self.rounding
        under, over = self.lower - rounding - q, q - self.upper - rounding
        moved = np.where(under > 0, q + turn * np.ceil(under / turn), q)
        moved = np.where(over > 0, q - turn * np.ceil(over / turn), moved)
        fits = (moved >= self.lower - rounding) & (moved <= self.upper + rounding)
        return np.where(self.revolute & fits, moved, q)


@dataclass(frozen=True)
class Cut:
    """A crossing of a joint limit by a self-motion."""

    position: float  # arc length, rad (or m)
    joint: int  # number of the joint
    upper: bool  # whether it is the upper limit
    entering: bool  # whether what follows is within limits


def limit_cuts(
    track: Track, limits: JointRange, options: LimitCutOptions = LimitCutOptions()
) -> tuple[Cut, ...]:
    """Crossings of joint limits by a curve, in order.

    Pieces shorter than the knots' distance over ``options.between`` may be missed.
    """
    knots = track.positions
    if len(knots) < 2:
        return ()
    ends = _ends(track, limits, options.at_end)
    parts = np.arange(options.between) / options.between
    dense = np.append((knots[:-1, None] + np.diff(knots)[:, None] * parts).ravel(), knots[-1])
    inside = limits.inside(track.cubic(dense)[0])
    rows = np.flatnonzero(inside[1:] != inside[:-1])
    if not len(rows):
        return ends
    low, high, entering = dense[rows], dense[rows + 1], inside[rows + 1]
    for _ in range(options.halvings):
        middle = (low + high) / 2
        before = limits.inside(track.cubic(middle)[0]) != entering
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    s, count = (low + high) / 2, np.arange(len(rows))
    joint = limits.excess(track.cubic(s)[0]).argmax(axis=1)
    for _ in range(options.corrections):
        q, slope = track.closed(s), track.cubic(s)[1]
        side = np.where(limits.offset(q)[count, joint] > 0, 1.0, -1.0)
        rate = slope[count, joint] * side
        sound = np.abs(rate) > options.slowest
        step = limits.excess(q)[count, joint] / np.where(sound, rate, 1.0)
        s = np.where(sound & (np.abs(step) < dense[1]), s - step, s)
    side = limits.offset(track.closed(s))[count, joint]
    columns = zip(s, joint, side, entering, strict=True)
    cuts = [Cut(float(x), int(j), bool(sign > 0), bool(enters)) for x, j, sign, enters in columns]
    return tuple(sorted((*cuts, *ends), key=lambda cut: cut.position))


def _ends(track: Track, limits: JointRange, near: float) -> tuple[Cut, ...]:
    """Ends of a curve at limits of sliding joints, to some distance: it does not go on beyond."""
    cuts = []
    for k in () if track.loop else (0, -1):
        excess = limits.excess(track.points[k][None])[0]
        j = int(np.where(limits.revolute, -np.inf, excess).argmax())
        if abs(excess[j]) < near and excess.max() < near and not limits.revolute[j]:
            upper = bool(limits.offset(track.points[k][None])[0, j] > 0)
            cuts.append(Cut(float(track.positions[k]), j, upper, k == 0))
    return tuple(cuts)


def allowed_pieces(
    length: float, cuts: tuple[Cut, ...], within: bool
) -> tuple[tuple[float, float], ...]:
    """Intervals of arc length in which a curve is within limits."""
    edges = [0.0] if within else []
    edges += [cut.position for cut in cuts]
    if len(edges) % 2:
        edges.append(length)
    return tuple(zip(edges[::2], edges[1::2], strict=True))
