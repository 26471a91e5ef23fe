"""Distance tests of two arms in all combinations of their postures, by balls and segments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.collision.segments import UNSURE, Segments, segment_distances
from copose.poses import Array, Indices, Mask
from copose.progress import heed

# Combinations that are tested together where they are few of all.
_FEW = 500
# Combinations times pairs of bodies that are tested together where they are not.
_MANY = 200_000
# From how many times as many as are asked for on all combinations are not looked at.
_SPARSE = 4
# By what share of squares of lengths those of distances are rounded.
_ROUNDED = 1e-14


@dataclass(frozen=True, eq=False)
class TwoArms:
    """Pairs of solids of two arms, in all postures of each.

    Attributes:
        i: the first arm.
        j: the other.
        centres: of balls round the first arm's solids, (count, p, 3).
        others: of the other's, (count', p, 3).
        squares: of how far apart centres are where the clearance is kept, m², (p,).
        segments: that the first's round solids are all within a radius of, as the centres.
        beside: alike of the other's.
        round: which pairs are of round solids, (p,).
        least: how far apart their segments are where they keep the clearance, m, (p,).
    """

    i: int
    j: int
    centres: Array
    others: Array
    squares: Array
    segments: Segments
    beside: Segments
    round: Mask
    least: Array

    def judged(self, chosen: Indices) -> tuple[Mask, Mask]:
        """Which combinations of all arms, (count, K), are undecided, and which are too near,
        (count,) each.
        """
        rows, columns = chosen[:, self.i], chosen[:, self.j]
        if not len(chosen) or not len(self.squares):
            return _none(len(chosen)), _none(len(chosen))
        one, other = (np.flatnonzero(np.bincount(each)) for each in (rows, columns))
        if len(one) * len(other) > _SPARSE * len(chosen):
            return self._of_few(rows, columns)
        unsure, hit = self._of_all(one, other)
        return unsure[rows, columns], hit[rows, columns]

    def _of_few(self, rows: Indices, columns: Indices) -> tuple[Mask, Mask]:
        """The same of postures, (k,) each."""
        unsure, hit = _none(len(rows)), _none(len(rows))
        for first in range(0, len(rows), _FEW):
            heed()
            some = slice(first, first + _FEW)
            gaps = self.centres[rows[some]] - self.others[columns[some]]
            close = np.einsum("kpx,kpx->pk", gaps, gaps) < self.squares[:, None]
            unsure[some], hit[some] = self._told(close, rows[some], columns[some])
        return unsure, hit

    def _of_all(self, one: Indices, other: Indices) -> tuple[Mask, Mask]:
        """The same of all combinations of some postures, (count, count') each.

        Squares of distances less what they have to be are products of matrices.
        """
        shape = len(self.centres), len(self.others)
        unsure, hit = _none(*shape), _none(*shape)
        middle = self.others.mean(axis=(0, 1))
        a, b = self.centres[one] - middle, self.others[other] - middle
        aa, bb = (np.sum(x**2, axis=2, keepdims=True) for x in (a, b))
        limits = self.squares[:, None] + _ROUNDED * max(float(aa.max()), float(bb.max()))
        left = np.concatenate([a, aa, np.ones_like(aa)], axis=2).swapaxes(0, 1)
        right = np.concatenate([-2 * b, np.ones_like(bb), bb - limits], axis=2).transpose(1, 2, 0)
        step = max(1, _MANY // (len(other) * len(limits)))
        for first in range(0, len(one), step):
            heed()
            some = one[first : first + step]
            close = (left[:, first : first + step] @ right < 0).reshape(len(limits), -1)
            both = self._told(close, np.repeat(some, len(other)), np.tile(other, len(some)))
            for found, told in zip((unsure, hit), both, strict=True):
                found[np.ix_(some, other)] = told.reshape(len(some), -1)
        return unsure, hit

    def _told(self, close: Mask, rows: Indices, columns: Indices) -> tuple[Mask, Mask]:
        """The same of postures, (k,) each, by what pairs have balls that are close, (p, k)."""
        hit = _none(len(rows))
        pairs, which = np.nonzero(close & self.round[:, None])
        if len(pairs):
            missing = self.least[pairs] - segment_distances(
                self.segments.at(rows[which], pairs), self.beside.at(columns[which], pairs)
            )
            close[pairs, which] = missing > -UNSURE
            hit[which[missing > UNSURE]] = True
        return np.asarray(close.any(axis=0) & ~hit), hit


def _none(*shape: int) -> Mask:
    return np.zeros(shape, dtype=np.bool_)
