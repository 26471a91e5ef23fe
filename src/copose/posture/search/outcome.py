"""Outcome of a search for postures: its local optima, and the evidence for them."""

from __future__ import annotations

from dataclasses import dataclass

from copose.constraints.clearance import Blocked
from copose.poses import Array
from copose.posture.optimum import LocalOptimum, LocalSolve
from copose.self_motion.sampling import ArmSample


@dataclass(frozen=True, eq=False)
class SearchOutcome:
    """Local optima that a search found, and what it tried.

    Attributes:
        samples: of every arm.
        combinations: that were evaluated.
        best_sample: the objective of the best combination before polishing.
        starts: combinations that were polished.
        optima: distinct local optima, best first.
        met: how many climbs ended in each, those too that are no answer.
        failures: how polishing failed, and how often.
        bound: of the objective of every combination, from above; None where that is not known.
        best: the best combination before polishing, (N,); None where there is none.
        blocked: what comes too near in all postures of an arm.
    """

    samples: tuple[ArmSample, ...] = ()
    combinations: int = 0
    best_sample: float | None = None
    bound: float | None = None
    starts: int = 0
    optima: tuple[LocalOptimum, ...] = ()
    met: tuple[int, ...] = ()
    failures: tuple[LocalSolve, ...] = ()
    best: Array | None = None
    blocked: tuple[Blocked, ...] = ()

    @property
    def closed(self) -> bool:
        """True where every sampled arm has a posture that holds the object."""
        return all(len(sample.closed) for sample in self.samples)
