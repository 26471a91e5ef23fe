"""Postures of all cases with everything that is free beside the joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from copose.poses import Array

FreePoses: TypeAlias = tuple[Array, ...]
"""The free coordinates of every case, (d,) each; the arms' are the same in all."""


@dataclass(frozen=True, eq=False)
class Placed:
    """Postures of all cases, with everything that is free.

    Attributes:
        x: free coordinates.
        q: stacked joints by case, (N,) each.
        value: Σ weight · objective.
        count: how many starts ended here.
        converged: whether what is here met the tolerance of a climb.
    """

    x: FreePoses
    q: tuple[Array, ...]
    value: float
    count: int = 1
    converged: bool = False
