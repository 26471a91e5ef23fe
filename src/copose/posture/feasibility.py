"""Postures that keep the constraints of a problem, beside the closed chain and joint limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from copose.cell.context import PostureContext
from copose.constraints.posture_constraint import PostureConstraint
from copose.poses import Array, Mask
from copose.posture.optimum import LocalOptimum


@dataclass(frozen=True, eq=False)
class Feasibility:
    """Tests of stacked postures, (count, N), against constraints, in the order of these."""

    constraints: tuple[PostureConstraint, ...]

    @property
    def judged(self) -> bool:
        """True where some are too slow to ask of every combination, see `PostureConstraint`."""
        return any(constraint.judged for constraint in self.constraints)

    def allowed(self, context: PostureContext, q: Array) -> Mask:
        """A mask of the postures that keep all constraints, (count,)."""
        return self._kept(self.constraints, context, q)

    def clear(self, context: PostureContext, q: Array) -> Mask:
        """A mask of the postures that keep what screening asks of all, the clearance, (count,)."""
        return self._kept([c for c in self.constraints if not c.judged], context, q)

    def held(self, context: PostureContext, q: Array) -> Mask:
        """A mask of the postures that keep what is judged, such as ``static_torque``, (count,)."""
        return self._kept([c for c in self.constraints if c.judged], context, q)

    def first_apart(
        self, context: PostureContext, optima: Sequence[LocalOptimum], most: int = 16
    ) -> LocalOptimum | None:
        """The first that keeps the clearance, of as many as are worth the time."""
        return next((o for o in islice(optima, most) if self.clear(context, o.q[None])[0]), None)

    @staticmethod
    def _kept(constraints: Sequence[PostureConstraint], context: PostureContext, q: Array) -> Mask:
        kept = np.ones(len(q), dtype=bool)
        for constraint in constraints:
            if kept.any():
                kept[kept] = constraint.allows(context, context.cell.system.split(q[kept]))
        return kept
