"""The interface of a constraint on postures, beside the closed chain and joint limits.

Screening, judging, programs, acceptance and the notes of a result ask a constraint, and never
which one it is. A constraint is one class and one entry of `registry.CONSTRAINTS`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar, Self

import casadi as ca
import numpy as np

from copose.capability import Sums
from copose.cell.cell import Cell
from copose.cell.context import PostureContext
from copose.cell.dynamics import CellDynamics
from copose.constraints.constraint import ConstraintTerm
from copose.mechanics import System
from copose.poses import Array, Mask
from copose.results import Posture


class PostureConstraint(ABC):
    """A condition that a posture must keep."""

    name: ClassVar[str]
    """Name of the variables that it adds to a program, and in the reason where it allows none."""
    torque_limited: ClassVar[bool] = False
    """True where torque limits decide."""
    judged: ClassVar[bool] = True
    """True where `allows` is asked of the combinations that screening chooses; false for the
    clearance alone, which screening asks of all by pairs of arms."""
    sums: Sums | None = None
    """Sums over the arms by which screening rules out what certainly breaks it."""

    @classmethod
    @abstractmethod
    def of(cls, cell: Cell, *, moving: bool) -> Self | None:
        """The constraint as a problem asks for it, of its postures or, ``moving``, of the knots of
        its path; None where it does not.
        """

    @abstractmethod
    def allows(self, context: PostureContext, q: Sequence[Array]) -> Mask:
        """A mask of the postures, by arm (count, n_i), that keep it, (count,)."""

    def shares(self, context: PostureContext, q: Sequence[Array]) -> Array | None:
        """Shares of a limit that postures, by arm (count, n_i), use, (count,), where that is told
        of many postures.
        """
        return None

    def certainly_broken(self, sums: ca.SX, weight: ca.SX, n_joints: int) -> ca.SX:
        """True where its `sums` tell that no posture with them keeps it; false where they cannot.

        Args:
            sums: of all arms.
            weight: what holds the object against gravity, (b,).
            n_joints: of all arms.
        """
        return ca.SX(0)

    def term(self, system: System, capacity: CellDynamics | None) -> ConstraintTerm | None:
        """The term in every program; None where its rows are generated as programs need them.

        The equations of motion are given where torque limits matter.
        """
        return None

    def starts(self, context: PostureContext, q: Sequence[Array]) -> Array:
        """Starts of the term's variables at postures, by arm (count, n_i); (count, v)."""
        return np.zeros((len(q[0]), 0))

    @abstractmethod
    def kept(self, posture: Posture) -> bool:
        """True where a measured posture keeps it."""

    def note(self, posture: Posture) -> str | None:
        """A sentence on how a measured posture breaks it, unless the measurement has it already."""
        return None
