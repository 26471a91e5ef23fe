"""The largest acceleration along a direction, as an objective."""

from __future__ import annotations

from collections.abc import Sequence

from copose.capability.torque_limits import Demand
from copose.cell.dynamics import Holding
from copose.objectives.objective import LimitReport
from copose.objectives.torque_limited import TorqueLimited
from copose.poses import Array
from copose.problem import Space


class Acceleration(TorqueLimited):
    """The largest acceleration along a direction, others zero; of several the smallest."""

    def __init__(self, unit: str, limits: Sequence[Array], directions: Array, space: Space) -> None:
        """Along unit directions, (k, m)."""
        super().__init__("acceleration", unit, limits, len(directions), space)
        self.directions = directions

    def demands(self, holding: Holding) -> tuple[Demand, ...]:
        """One for each direction."""
        return tuple(holding.acceleration(u) for u in self.directions)

    def report(self, limits: LimitReport) -> float | None:
        """The acceleration along each direction, by number where there are several."""
        names = ["acceleration"]
        if len(self.directions) > 1:
            names = [f"acceleration {k + 1}" for k in range(len(self.directions))]
        stated = [
            limits.acceleration(u, name) for u, name in zip(self.directions, names, strict=True)
        ]
        values = [value for value in stated if value is not None]
        return min(values) if len(values) == len(stated) else None
