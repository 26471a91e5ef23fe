"""Local optima, where climbs end."""

from __future__ import annotations

from dataclasses import dataclass

from copose.poses import Array


@dataclass(frozen=True, eq=False)
class LocalOptimum:
    """A distinct end of the polishing: stacked joints, objective, how many starts ended there."""

    q: Array
    objective: float
    count: int
