"""Evidence of a search: samples, local optima, failures and verification."""

from __future__ import annotations

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
        failures: polishes that ended nowhere.
        verification: of the answer, where it was asked for.
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
    failures: tuple[FailureRecord, ...] = ()
    verification: VerificationRecord | None = None
    placements: PlacementRecord | None = None
