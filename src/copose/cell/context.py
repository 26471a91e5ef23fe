"""Postures with the object in one place, and what evaluates them there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from copose.capability.torque_limits import Dynamics
from copose.cell.cell import Cell
from copose.cell.dynamics import CellDynamics, Holding
from copose.collision import Bodies
from copose.poses import Array


@dataclass(frozen=True, eq=False)
class PostureContext:
    """A cell with its object in one place, as objectives and constraints are evaluated there.

    Attributes:
        cell: the object's pose is its problem's.
        numbers: parameters of the objective.
        capacity: equations of motion, where torque limits matter.
        holding: how the object is held, alike.
        bodies: what must keep the clearance; None where nothing need.
        sums: sums of the arms' terms, (count, s), of postures by arm, (count, n_i).
        grams: G of such sums as it is optimised, (count, a, a), where an ellipsoid is measured.
    """

    cell: Cell
    numbers: Array
    capacity: CellDynamics | None
    holding: Holding | None
    bodies: Bodies | None
    sums: Callable[[Sequence[Array]], Array]
    grams: Callable[[Array], Array]

    @property
    def loaded(self) -> tuple[CellDynamics, Holding]:
        """Equations of motion and the held object, where torque limits matter."""
        assert self.capacity is not None and self.holding is not None
        return self.capacity, self.holding

    def dynamics(self, q: Sequence[Array], *, moments: bool = True) -> Dynamics:
        """The equations of motion at postures, by arm (count, n_i).

        Args:
            q: the postures.
            moments: whether moments balance in the linear spaces too, and limits of contact
                wrenches count.
        """
        capacity, holding = self.loaded
        held = holding if moments else holding.forces_alone
        return capacity.dynamics(held, q, bounded=moments)
