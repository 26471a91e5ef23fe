"""Evidence of a search: samples, local optima, failures and verification."""

from __future__ import annotations

import math
from collections.abc import Sequence

from copose.results.records import Finite, Record, Vector


class Optimum(Record):
    """A distinct local optimum.

    Attributes:
        objective: its value.
        count: polished starts that ended in it.
        joints: where, rad or m, by arm; null where more than joints is free.
    """

    objective: Finite
    count: int
    joints: dict[str, Vector] | None = None


class SampleRecord(Record):
    """Sample of one arm's self-motions.

    Attributes:
        tried: random postures that were projected onto the grasp.
        closed: postures within limits that entered the search.
        branches: self-motions found; null where more than one degree of freedom is to spare.
    """

    tried: int
    closed: int
    branches: int | None


class FailureRecord(Record):
    """A way in which polishing failed, in IPOPT's words, and how often."""

    status: str
    count: int


class VerificationRecord(Record):
    """A second search with a seed of its own and twice the effort.

    Attributes:
        seed: of the second search.
        objective: its best.
        stands: whether it is no better than the first one's by more than 1e-6.
    """

    seed: int
    objective: Finite | None
    stands: bool


class BasinRecord(Record):
    """The basins of attraction that climbs ended in: how often, and what may have been missed.

    The Good-Turing estimate of the probability that the next draw is of a species not seen is the
    number of species seen exactly once over that of draws (I. J. Good, 1953). Here the species are
    basins and the draws the climbs that converged: it estimates the share of further starts, chosen
    as these were, that would lead to a basin not met. Those of a better optimum are among them, so
    it estimates that share from above; it is no bound, and tells nothing of starts that a search
    would never choose.

    Attributes:
        converged: climbs that ended in a local optimum.
        best: of them, that ended in one worth as much as the answer.
        unseen: the Good-Turing estimate; null where none converged.
    """

    converged: int
    best: int
    unseen: Finite | None

    @classmethod
    def of(
        cls,
        optima: Sequence[Optimum],
        answer: float | None,
        counts: Sequence[int] | None = None,
        tolerance: float = 1e-6,
    ) -> BasinRecord:
        """The record of distinct optima.

        Args:
            optima: those that count as answers.
            answer: objective of the answer; None where there is none.
            counts: climbs that ended in each optimum, those too that are no answer; left out, those
                of ``optima``.
            tolerance: relative to 1 + its magnitude, by which an optimum may be worth less than the
                answer and count as it.
        """
        counts = [optimum.count for optimum in optima] if counts is None else counts
        converged, once = sum(counts), sum(count == 1 for count in counts)
        least = math.inf if answer is None else answer - tolerance * (1 + abs(answer))
        return cls(
            converged=converged,
            best=sum(optimum.count for optimum in optima if optimum.objective >= least),
            unseen=once / converged if converged else None,
        )


class ProofMapAxis(Record):
    """Postures evenly along what joint limits leave of an arm's self-motions, side by side.

    Attributes:
        arm: its name.
        self_motions: number of the self-motion of each posture, from 1 on.
        cuts: indices of postures before which a joint is beyond its limits.
        length: arc length of all together, rad.
        answer: index of the posture nearest to the answer.
    """

    arm: str
    self_motions: tuple[int, ...]
    cuts: tuple[int, ...]
    length: Finite
    answer: int


class ProofMap(Record):
    """The objective over the self-motions of two arms, and where its bound was the hardest.

    Attributes:
        x: postures of one arm.
        y: of the other.
        values: the objective, to four digits, a row for each of y; null where there is none.
        last: pairs of indices into x and y: combinations that were ruled out last, or were left.
    """

    x: ProofMapAxis
    y: ProofMapAxis
    values: tuple[tuple[Finite | None, ...], ...]
    last: tuple[tuple[int, int], ...]


class ProofRecord(Record):
    """A proof that no posture beats the answer by more than some ε, as far as it went.

    Attributes:
        epsilon: ε that was asked for, in the objective's unit.
        bound: no posture on the self-motions is worth more; null where nothing is proved.
        gap: that less the answer.
        statement: what is proved, in a sentence, or why nothing is.
        assumptions: under which it is.
        self_motions: of each arm, or its postures where it has nothing to spare, by arm.
        slices: that met them, by arm.
        odd: slices with an odd number of postures, in which one may be missing.
        segments: of the self-motions that were bounded, by arm.
        combinations: of segments, and of runs of them, that were bounded.
        seconds: that it took.
        map: of the objective; null but of two arms with one degree of freedom to spare each.
    """

    epsilon: Finite
    bound: Finite | None
    gap: Finite | None
    statement: str
    assumptions: tuple[str, ...]
    self_motions: dict[str, int]
    slices: dict[str, int]
    odd: int
    segments: dict[str, int]
    combinations: int
    seconds: Finite
    map: ProofMap | None = None


class PlacementRecord(Record):
    """Placements that were tried: values of the free coordinates.

    Attributes:
        tried: placements, the file's first, at which all postures were searched.
        closed: of them, at which every arm holds the object.
        polished: postures from which everything free was polished together.
    """

    tried: int
    closed: int
    polished: int


class SearchRecord(Record):
    """The evidence of a search.

    Attributes:
        seed: of everything that was drawn.
        effort: low, normal, high or the name of another; ``local`` where a posture was given to go
            on from.
        samples: by arm.
        combinations: of the arms' postures that were evaluated.
        best_sample: the objective of the best of them.
        bound: no combination of these samples is worth more, and `best_sample` is no larger; null
            where that is not known. What polishing finds between samples may be.
        gap: what polishing added to that.
        starts: combinations that were polished.
        local_optima: where they ended, best first.
        basins: how often the best was met, and what may have been missed; of all optima, those too
            that bodies or reach rule out. Null where the search had to end before it told.
        failures: polishes that ended nowhere.
        verification: of the answer, where it was asked for.
        proof: that nothing beats the answer, where it was asked for.
        placements: where more than joints is free; the other counts are then sums over them.
    """

    seed: int
    effort: str
    samples: dict[str, SampleRecord]
    combinations: int
    best_sample: Finite | None
    bound: Finite | None = None
    gap: Finite | None
    starts: int
    local_optima: tuple[Optimum, ...]
    basins: BasinRecord | None = None
    failures: tuple[FailureRecord, ...] = ()
    verification: VerificationRecord | None = None
    proof: ProofRecord | None = None
    placements: PlacementRecord | None = None
