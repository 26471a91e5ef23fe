"""Fast tests of all combinations of the arms' postures, by balls and segments of their solids."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from copose.collision.distance.paired_solids import PairedSolids
from copose.collision.distance.round_solids import RoundSolids
from copose.collision.distance.two_arms import TwoArms
from copose.poses import Array, Indices, Mask


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
