"""Ends of local searches: local optima, and what a run of IPOPT tells of itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array


@dataclass(frozen=True, eq=False)
class LocalOptimum:
    """A distinct end of the polishing: stacked joints, objective, how many starts ended there."""

    q: Array
    objective: float
    count: int


@dataclass(frozen=True, eq=False)
class LocalSolve:
    """The end of one run of IPOPT.

    Attributes:
        q: joint positions of all arms, stacked, (N,); where more is free, that after the joints.
        converged: whether IPOPT met its tolerance.
        status: in IPOPT's words.
        violations: the largest violation of each constraint, by name.
        optimality: the scaled error of the optimality conditions, infinite where none is known.
    """

    q: Array
    converged: bool
    status: str
    violations: dict[str, float]
    optimality: float = np.inf
