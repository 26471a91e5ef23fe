"""A cell with its object in one place, as kernels, objectives and constraints take it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.cell.context import PostureContext
from copose.constraints.clearance import configurations_of
from copose.objectives.objective import Objective
from copose.poses import Array
from copose.self_motion.kernels import KernelInputs


@dataclass(frozen=True, eq=False)
class Setting(PostureContext):
    """A cell with its object somewhere, and what the kernels take for it.

    Attributes:
        objective: what is maximised there.
        placement: of the object, as the arms' kernels take it.
        given: M_o, the object's weight and the objective's numbers, as the score's kernels take
            them.
        lower: joint limits by arm; infinite for joints that can turn all the way, which have none.
        upper: alike.
        ties: of each constraint whose sums rule postures out, what its kernels take, by arm.
    """

    objective: Objective
    placement: KernelInputs
    given: Array
    lower: tuple[Array, ...]
    upper: tuple[Array, ...]
    ties: tuple[tuple[Array, ...], ...]

    def configurations(self, q: Sequence[Array | None]) -> Array:
        """Poses of all bodies, see `configurations_of`."""
        return configurations_of(self.cell, q)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Limits of all joints, stacked."""
        return np.concatenate(self.lower), np.concatenate(self.upper)
