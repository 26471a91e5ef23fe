"""Segments of an arm's self-motions, and what bounds its terms on each from below or above."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.cell.cell import Cell
from copose.poses import Array, Indices, Mask
from copose.progress import heed
from copose.proof.arm_terms import ArmTerms
from copose.proof.taylor import Taylor
from copose.self_motion.manifold import ClosureManifold


@dataclass(frozen=True)
class SegmentOptions:
    """Cutting of self-motions into segments."""

    at_once: int = 400  # segments that are enclosed together
    halvings: int = 14  # of a piece that cannot be proved, at most
    patient: int = 10  # of them that are also made for tighter bounds
    loosest: float = 0.03  # distance of a bound from the terms, relative, with which a proof begins
    ends: float = 1e-9  # distance of a segment's ends from its tube, rad
    closed: float = 1e-11  # residual of a middle, m and rad


class MotionSegments:
    """A growing table of segments of one arm.

    Attributes:
        sides: numbers of the matrices that are bounded, and whether from above.
        ends: postures at both ends, (count, 2, n).
        bounds: matrices at both ends, which interpolated bound the terms on the segment, of the
            axes that count, (sides, 2, a, a, count).
        loose: about their distance from the terms, relative, (count,).
        lost: pieces that could not be enclosed.
    """

    def __init__(
        self,
        cell: Cell,
        i: int,
        terms: ArmTerms,
        manifold: ClosureManifold,
        sides: Sequence[tuple[int, bool]],
        options: SegmentOptions = SegmentOptions(),
    ) -> None:
        """No segments yet of arm i."""
        self._axes = list(cell.problem.axes)
        self._cell, self._i, self._terms, self._manifold = cell, i, terms, manifold
        self.sides, self._options, self.lost = sides, options, 0
        self.ends, self.loose = np.zeros((0, 2, manifold.kernels.n)), np.zeros(0)
        self.bounds = np.zeros((len(sides), 2, len(self._axes), len(self._axes), 0))

    def add(self, ends: Array, loosest: float | None = None) -> Indices:
        """Enclose pieces, halved until they are proved; the piece that each new segment is of.

        What is beyond limits all along is left out.

        Args:
            ends: postures at both ends, (count, 2, n).
            loosest: distance of bounds from the terms, relative; that of the options.
        """
        options, source, added = self._options, np.arange(len(ends)), [np.zeros(0, dtype=np.intp)]
        for halving in range(options.halvings + 1):
            most = (loosest or options.loosest) if halving < options.patient else np.inf
            left, middles = np.zeros(len(ends), dtype=bool), np.zeros_like(ends[:, 0])
            for first in range(0, len(ends), options.at_once):
                heed()
                part = slice(first, first + options.at_once)
                left[part], middles[part], rows = self._enclose(ends[part], most)
                added.append(source[part][rows])
            # A posture has no halves.
            self.lost += int((left & _single(ends)).sum())
            left &= ~_single(ends)
            a, b, c, source = ends[left, 0], ends[left, 1], middles[left], np.tile(source[left], 2)
            ends = np.concatenate([np.stack([a, c], axis=1), np.stack([c, b], axis=1)])
        self.lost += len(ends)
        return np.concatenate(added)

    def halved(self, rows: Indices) -> tuple[Indices, Indices]:
        """The numbers of the segments that halves of segments are, and how many each has."""
        ends, known = self.ends[rows], len(self.ends)
        middles = self.middles(ends)[0]
        lines = np.flatnonzero(~_single(ends))
        second = np.stack([middles, ends[:, 1]], axis=1)[lines]
        added = self.add(np.concatenate([np.stack([ends[:, 0], middles], axis=1), second]), np.inf)
        parents = np.concatenate([np.arange(len(rows)), lines])[added]
        numbers = known + np.argsort(parents, kind="stable")
        return numbers, np.bincount(parents, minlength=len(rows))

    def middles(self, ends: Array) -> tuple[Array, Array, Mask]:
        """Closed postures in the middle of pieces, unit tangents there, and which are closed."""
        middle, v = ends.mean(axis=1), ends[:, 1] - ends[:, 0]
        closed = np.ones(len(ends), dtype=bool)
        if self._manifold.spare == 0:
            return middle, v, closed
        v = v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-300)
        for _ in range(3):
            step = self._manifold.many(len(ends)).step(
                middle, v, np.zeros(len(v)), np.zeros_like(v), self._options.closed
            )
            closed = step.closed & np.isfinite(step.q + step.tangent).all(axis=1)
            middle, v = (np.where(closed[:, None], new, old)
                         for new, old in ((step.q, middle), (step.tangent, v)))  # fmt: skip
        return middle, v, closed

    def _enclose(self, ends: Array, loosest: float) -> tuple[Mask, Array, Indices]:
        """Add those pieces that are proved; which are left, the middles of all, and which were
        added.
        """
        middle, v, closed = self.middles(ends)
        offset, more = ends - middle[:, None], self._options.ends
        t = (offset * v[:, None]).sum(axis=2)
        # A little longer: ends are not quite on the self-motion.
        q, ok = self._terms.tubes.enclosed(middle, v, np.abs(t).max(axis=1) + more)
        s = t[..., None]
        aside = np.abs(offset - s * v[:, None] - s**2 * q.curvature.mid[:, None])
        ok &= closed & (aside <= s**2 * q.curvature.rad[:, None] + more).all(axis=(1, 2))
        left = ~(ok & self._beyond(q))
        use = np.flatnonzero(ok & left)
        if not len(use):
            return left, middle, use
        models, proved = self._terms.enclosed(q.taken(use))
        bounds, loose = [], np.zeros(len(use))
        for term, upper in self.sides:
            vertices, off = models[term].vertices(t[use] + [-more, more], upper=upper)
            bounds.append(vertices[:, :, self._axes][..., self._axes])
            loose = np.maximum(loose, off)
        fine = proved & (loose < loosest) & np.isfinite(loose)
        left[use[fine]] = False
        self.ends = np.concatenate([self.ends, ends[use[fine]]])
        new = np.moveaxis(np.stack(bounds, axis=1)[fine], 0, -1)
        self.bounds = np.concatenate([self.bounds, new], axis=-1)
        self.loose = np.concatenate([self.loose, loose[fine]])
        return left, middle, use[fine]

    def _beyond(self, q: Taylor) -> Mask:
        """Segments on which a joint is beyond its limits all along, whichever turn it is in."""
        low, high = q.whole.mid - q.whole.rad, q.whole.mid + q.whole.rad
        lower, upper = self._cell.lower[self._i], self._cell.upper[self._i]
        bounded = np.isfinite(lower) & np.isfinite(upper)
        lower = np.where(bounded, lower, 0.0)
        turns = 2 * np.pi * np.ceil((lower - high) / (2 * np.pi))
        return np.asarray((bounded & (low + turns > upper)).any(axis=1))


def _single(ends: Array) -> Mask:
    """Pieces that are single postures."""
    return np.asarray((ends[:, 0] == ends[:, 1]).all(axis=1))
