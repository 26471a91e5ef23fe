"""The largest mass that can be held or accelerated, as an objective."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from copose.capability import HoldingTorque
from copose.capability.torque_limits import Demand, JointMotion
from copose.cell.dynamics import CellDynamics, Holding
from copose.objectives.objective import LimitReport
from copose.objectives.torque_limited import TorqueLimited
from copose.poses import Array
from copose.problem import Space


class Payload(TorqueLimited):
    """The largest mass held with every joint at rest, or accelerated in a certain way with the
    least-norm joint accelerations.
    """

    def __init__(self, limits: Sequence[Array], acceleration: Array, space: Space) -> None:
        """The object accelerated with a_o, (m,), or at rest."""
        self.acceleration = acceleration
        self.joints = JointMotion.LEAST_NORM if acceleration.any() else JointMotion.REST
        sums = HoldingTorque(moving=self.joints is JointMotion.LEAST_NORM)
        super().__init__("payload", "kg", limits, 1, space, sums)

    def demands(self, holding: Holding) -> tuple[Demand, ...]:
        """A demand in proportion to the mass."""
        return (holding.payload(self.acceleration),)

    def size(self, capacity: CellDynamics) -> float:
        """A mass that weighs as much as an arm can push with."""
        return float(capacity.sizes[1].max() / 9.81)

    def carried(self, motion: ca.SX, mass: ca.SX) -> ca.SX:
        """The acceleration, per kg, in proportion to t."""
        return ca.horzcat(ca.SX(motion.shape[0], 1), motion[:, 0] / mass)

    def score(self, sums: ca.SX, M_o: ca.SX, numbers: ca.SX, axes: Sequence[int]) -> ca.SX:
        """The largest mass with the box of torques taken for an ellipsoid."""
        ((motion, load),) = self.parted(numbers)
        total = sum(len(scale) for scale in self.scales)
        moving = motion[:, 0] if self.joints is JointMotion.LEAST_NORM else None
        return HoldingTorque.farthest(sums, load, total, moving)

    def report(self, limits: LimitReport) -> float | None:
        """The mass as it is stated."""
        return limits.payload(self.acceleration)
