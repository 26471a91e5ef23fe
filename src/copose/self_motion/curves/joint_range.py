"""What joint limits leave of a curve of postures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.cell.cell import Cell
from copose.poses import Array, Mask
from copose.self_motion.curves.arc_length import Track

_TURN = 2 * np.pi
# What is within limits to rounding, rad (or m).
_ROUNDING = 1e-9
# Places between knots of a curve at which limits are asked.
_BETWEEN = 8
# Halvings that find where a limit is met, and corrections of it on the curve itself.
_HALVINGS = 40
_CORRECTIONS = 2
# A sliding joint so near to a limit ends its curve, m.
_AT_END = 1e-6
# Slowest approach to a limit that a correction divides by, rad per rad.
_SLOWEST = 1e-3


@dataclass(frozen=True, eq=False)
class JointRange:
    """The limits of an arm's joints, whole turns of revolute joints apart.

    Attributes:
        lower: lowest positions, margin kept, −∞ where there is none, (n,).
        upper: highest, alike.
        revolute: which joints turn, (n,).
    """

    lower: Array
    upper: Array
    revolute: Mask

    @classmethod
    def of(cls, cell: Cell, i: int) -> JointRange:
        """That of arm i."""
        revolute = np.array([joint.kind == "revolute" for joint in cell.arms[i].joints], dtype=bool)
        return cls(cell.lower[i], cell.upper[i], revolute)

    @property
    def freed(self) -> tuple[Array, Array]:
        """Limits of sliding joints alone: others come back by themselves, (n,) each."""
        return (
            np.where(self.revolute, -np.inf, self.lower),
            np.where(self.revolute, np.inf, self.upper),
        )

    def excess(self, q: Array) -> Array:
        """How far each joint is beyond its limits, negative within, at postures: (count, n)."""
        half = np.where(self._limited, self.upper - self.lower, np.inf) / 2
        return np.asarray(np.abs(self.offset(q)) - half)

    def offset(self, q: Array) -> Array:
        """Joints of postures from the middle of their limits, by less than a turn, (count, n)."""
        low, high = (np.where(self._limited, x, 0.0) for x in (self.lower, self.upper))
        offset = q - (low + high) / 2
        return np.where(self.revolute, offset - _TURN * np.round(offset / _TURN), offset)

    @property
    def _limited(self) -> Mask:
        """Which joints have limits."""
        return np.isfinite(self.lower) & np.isfinite(self.upper)

    def inside(self, q: Array) -> Mask:
        """Which postures, (count, n), are within limits, whole turns apart: (count,)."""
        return np.asarray(self.excess(q).max(axis=1) <= _ROUNDING)

    def turned(self, q: Array) -> Array:
        """Postures, (count, n), with joints beyond a limit moved within by whole turns, if these
        help.
        """
        under, over = self.lower - _ROUNDING - q, q - self.upper - _ROUNDING
        moved = np.where(under > 0, q + _TURN * np.ceil(under / _TURN), q)
        moved = np.where(over > 0, q - _TURN * np.ceil(over / _TURN), moved)
        fits = (moved >= self.lower - _ROUNDING) & (moved <= self.upper + _ROUNDING)
        return np.where(self.revolute & fits, moved, q)


@dataclass(frozen=True)
class Cut:
    """A place where a joint limit cuts a self-motion.

    Attributes:
        position: arc length, rad (or m).
        joint: number of the joint.
        upper: whether it is the upper limit.
        entering: whether what follows is within limits.
    """

    position: float
    joint: int
    upper: bool
    entering: bool


def limit_cuts(track: Track, limits: JointRange) -> tuple[Cut, ...]:
    """Where limits cut a curve, in order; what is shorter than the knots' eighth may be missed."""
    knots = track.positions
    if len(knots) < 2:
        return ()
    ends = _ends(track, limits)
    parts = np.arange(_BETWEEN) / _BETWEEN
    dense = np.append((knots[:-1, None] + np.diff(knots)[:, None] * parts).ravel(), knots[-1])
    inside = limits.inside(track.cubic(dense)[0])
    rows = np.flatnonzero(inside[1:] != inside[:-1])
    if not len(rows):
        return ends
    low, high, entering = dense[rows], dense[rows + 1], inside[rows + 1]
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        before = limits.inside(track.cubic(middle)[0]) != entering
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    s, count = (low + high) / 2, np.arange(len(rows))
    joint = limits.excess(track.cubic(s)[0]).argmax(axis=1)
    for _ in range(_CORRECTIONS):
        q, slope = track.closed(s), track.cubic(s)[1]
        side = np.where(limits.offset(q)[count, joint] > 0, 1.0, -1.0)
        rate = slope[count, joint] * side
        sound = np.abs(rate) > _SLOWEST
        step = limits.excess(q)[count, joint] / np.where(sound, rate, 1.0)
        s = np.where(sound & (np.abs(step) < dense[1]), s - step, s)
    side = limits.offset(track.closed(s))[count, joint]
    each = zip(s, joint, side, entering, strict=True)
    met = [Cut(float(x), int(j), bool(sign > 0), bool(enters)) for x, j, sign, enters in each]
    return tuple(sorted((*met, *ends), key=lambda cut: cut.position))


def _ends(track: Track, limits: JointRange) -> tuple[Cut, ...]:
    """Where sliding joints end a curve, which does not go on beyond."""
    found = []
    for k in () if track.loop else (0, -1):
        excess = limits.excess(track.points[k][None])[0]
        j = int(np.where(limits.revolute, -np.inf, excess).argmax())
        if abs(excess[j]) < _AT_END and excess.max() < _AT_END and not limits.revolute[j]:
            upper = bool(limits.offset(track.points[k][None])[0, j] > 0)
            found.append(Cut(float(track.positions[k]), j, upper, k == 0))
    return tuple(found)


def allowed_pieces(
    length: float, cuts: tuple[Cut, ...], within: bool
) -> tuple[tuple[float, float], ...]:
    """From where to where a curve is within limits.

    Args:
        length: of the curve.
        cuts: in order.
        within: whether its start is.
    """
    edges = [0.0] if within else []
    edges += [cut.position for cut in cuts]
    if len(edges) % 2:
        edges.append(length)
    return tuple(zip(edges[::2], edges[1::2], strict=True))
