"""Tests of two arms in all combinations of their postures, by balls and segments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.collision.distance.segments import Segments, segment_distances
from copose.poses import Array, Indices, Mask
from copose.progress import heed


@dataclass(frozen=True)
class TwoArmsOptions:
    """Sizes of what is tested together."""

    few: int = 500  # combinations, where they are few of all
    products: int = 200_000  # combinations times pairs of solids, where they are not
    sparse: int = 4  # all combinations by those asked for, from which only the latter are tested
    rounded: float = 1e-14  # share of squares of lengths by which those of distances are rounded


@dataclass(frozen=True, eq=False)
class TwoArms:
    """Pairs of solids of two arms, in all postures of each."""

    i: int  # the first arm
    j: int  # the other
    centres: Array  # of balls round the first arm's solids, m, (count, p, 3)
    other_centres: Array  # of balls round the other's, m, (count', p, 3)
    squares: Array  # squared distances of centres at which the clearance is kept, m², (p,)
    segments: Segments  # of the first arm's round solids, as the centres
    other_segments: Segments  # of the other's
    round: Mask  # which pairs are of round solids, (p,)
    least: Array  # distances of their segments at which they keep the clearance, m, (p,)
    unsure: float  # how near to these distances nothing is decided, m
    options: TwoArmsOptions = TwoArmsOptions()  # sizes of what is tested together

    def verdicts(self, chosen: Indices) -> tuple[Mask, Mask]:
        """The combinations of all arms, (count, K), that are undecided, and those that are too
        near, (count,) each.
        """
        rows, columns = chosen[:, self.i], chosen[:, self.j]
        if not len(chosen) or not len(self.squares):
            return _none(len(chosen)), _none(len(chosen))
        one, other = (np.flatnonzero(np.bincount(postures)) for postures in (rows, columns))
        if len(one) * len(other) > self.options.sparse * len(chosen):
            return self._of_few(rows, columns)
        unsure, hit = self._of_all(one, other)
        return unsure[rows, columns], hit[rows, columns]

    def _of_few(self, rows: Indices, columns: Indices) -> tuple[Mask, Mask]:
        """The verdicts on some combinations of postures, (k,) each."""
        unsure, hit = _none(len(rows)), _none(len(rows))
        for first in range(0, len(rows), self.options.few):
            heed()
            block = slice(first, first + self.options.few)
            gaps = self.centres[rows[block]] - self.other_centres[columns[block]]
            close = np.einsum("kpx,kpx->pk", gaps, gaps) < self.squares[:, None]
            unsure[block], hit[block] = self._of_close(close, rows[block], columns[block])
        return unsure, hit

    def _of_all(self, one: Indices, other: Indices) -> tuple[Mask, Mask]:
        """The verdicts on all combinations of some postures, (count, count') each.

        Squares of distances less what they have to be are products of matrices.
        """
        shape = len(self.centres), len(self.other_centres)
        unsure, hit = _none(*shape), _none(*shape)
        middle = self.other_centres.mean(axis=(0, 1))
        a, b = self.centres[one] - middle, self.other_centres[other] - middle
        aa, bb = (np.sum(x**2, axis=2, keepdims=True) for x in (a, b))
        rounding = self.options.rounded * max(float(aa.max()), float(bb.max()))
        limits = self.squares[:, None] + rounding
        left = np.concatenate([a, aa, np.ones_like(aa)], axis=2).swapaxes(0, 1)
        right = np.concatenate([-2 * b, np.ones_like(bb), bb - limits], axis=2).transpose(1, 2, 0)
        step = max(1, self.options.products // (len(other) * len(limits)))
        for first in range(0, len(one), step):
            heed()
            block = one[first : first + step]
            close = (left[:, first : first + step] @ right < 0).reshape(len(limits), -1)
            both = self._of_close(close, np.repeat(block, len(other)), np.tile(other, len(block)))
            for table, verdict in zip((unsure, hit), both, strict=True):
                table[np.ix_(block, other)] = verdict.reshape(len(block), -1)
        return unsure, hit

    def _of_close(self, close: Mask, rows: Indices, columns: Indices) -> tuple[Mask, Mask]:
        """The verdicts on postures, (k,) each, by which pairs have balls that are close, (p, k)."""
        hit = _none(len(rows))
        pairs, which = np.nonzero(close & self.round[:, None])
        if len(pairs):
            missing = self.least[pairs] - segment_distances(
                self.segments.at(rows[which], pairs), self.other_segments.at(columns[which], pairs)
            )
            close[pairs, which] = missing > -self.unsure
            hit[which[missing > self.unsure]] = True
        return np.asarray(close.any(axis=0) & ~hit), hit


def _none(*shape: int) -> Mask:
    return np.zeros(shape, dtype=np.bool_)
