"""A distance that bodies keep from each other, as a constraint on postures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np

from copose.cell.cell import Cell
from copose.cell.context import PostureContext
from copose.constraints.clearance import configurations_of
from copose.constraints.posture_constraint import PostureConstraint
from copose.poses import Array, Mask
from copose.results import Posture


class KeptClearance(PostureConstraint):
    """Bodies keep a distance; rows of programs are generated from witness points, see `Apart`."""

    name = "clearance"
    judged = False

    def __init__(self, clearance: float) -> None:
        """A distance, m."""
        self.clearance = clearance

    @classmethod
    def of(cls, cell: Cell, *, moving: bool) -> Self | None:
        """The constraint that ``collision`` asks for."""
        limits = cell.problem.constraints
        return cls(limits.clearance) if limits.collision else None

    def allows(self, context: PostureContext, q: Sequence[Array]) -> Mask:
        """A mask of those whose bodies are far enough apart; all of a context without bodies."""
        if context.bodies is None or not len(q[0]):
            return np.ones(len(q[0]), dtype=bool)
        return context.bodies.clear(configurations_of(context.cell, q))

    def kept(self, posture: Posture) -> bool:
        """True where the smallest distance, if there is one, is large enough."""
        return posture.collision is None or posture.collision.distance >= self.clearance

    def note(self, posture: Posture) -> str | None:
        """The bodies that are too near."""
        if posture.collision is None or self.kept(posture):
            return None
        both = " and ".join(posture.collision.pair)
        if posture.collision.distance <= 0:
            return f"{both} overlap; the clearance is {self.clearance:g} m"
        return (
            f"{both} are nearer than the clearance, {self.clearance:g} m: "
            "[constraints] clearance sets it"
        )
