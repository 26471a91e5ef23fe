"""Fast tests of all combinations of the arms' postures, by balls and segments of their solids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from copose.collision.distance.paired_solids import PairedSolids
from copose.collision.distance.round_solids import RoundSolids
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


class ArmCombinations:
    """A test of combinations of postures, one of each arm: balls round the solids of different
    arms, or the solids themselves where they are round, lie apart or do not.
    """

    def __init__(
        self,
        solids: PairedSolids,
        round_solids: RoundSolids,
        postures: Sequence[Array],
        clearance: float,
        unsure: float,
        *,
        caution: float = 1e-9,
    ) -> None:
        """Place all solids of each arm in each of its postures, configurations by arm, (count_i,
        size), of which only its own joints count. So near to the clearance, m, distances of round
        solids decide nothing; ``caution`` is the share by which squares of distances of balls may
        be rounded.
        """
        arms, self._tables = solids.pair_arms[solids.shared], list[TwoArms]()
        where = [solids.placed(x) for x in postures]
        centres = [solids.ball_centres(placements) for placements in where]
        segments = [round_solids.segments(placements) for placements in where]
        for i, j in combinations(range(len(postures)), 2):
            forth, back = (solids.shared[(arms == both).all(axis=1)] for both in ([i, j], [j, i]))
            pairs = np.concatenate([forth, back])
            a, b = np.vstack([solids.pairs[forth], solids.pairs[back][:, ::-1]]).T
            least = solids.radii[a] + solids.radii[b] + clearance
            # Most never come near: the boxes round all places of their balls are apart.
            low, high = (
                np.array([f(centres[k], axis=0) for k in (i, j)]) for f in (np.min, np.max)
            )
            between = np.maximum(low[0, a] - high[1, b], low[1, b] - high[0, a])
            near = np.linalg.norm(np.maximum(between, 0.0), axis=1) < least * (1 + caution)
            a, b, pairs = a[near], b[near], pairs[near]
            self._tables.append(
                TwoArms(
                    i=i,
                    j=j,
                    centres=centres[i][:, a],
                    other_centres=centres[j][:, b],
                    squares=least[near] ** 2 * (1 + caution),
                    segments=segments[i].of(a),
                    other_segments=segments[j].of(b),
                    round=round_solids.both[pairs],
                    least=round_solids.radii[pairs] + clearance,
                    unsure=unsure,
                )
            )

    def verdicts(self, chosen: Indices) -> tuple[Mask, Mask]:
        """The combinations that are clear, and those that are not; what is in neither is undecided.

        Args:
            chosen: numbers of postures of all arms, (count, K).

        Returns:
            Two masks, (count,) each.
        """
        unsure, hit = (np.zeros(len(chosen), dtype=np.bool_) for _ in range(2))
        for table in self._tables:
            table_unsure, table_hit = table.verdicts(chosen)
            unsure |= table_unsure
            hit |= table_hit
        return ~(unsure | hit), hit
