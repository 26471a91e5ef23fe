"""The velocity and force ellipsoids of one posture, as a result states them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from copose.capability import (
    ClosedChainVelocity,
    Ellipsoid,
    ExternalForce,
    internal_force_factor,
    polar,
)
from copose.planning.cell import Cell
from copose.planning.parts import Parts, ellipsoid_of, sliced
from copose.poses import Array
from copose.results import EllipsoidRecord


class Companions:
    """Evaluates them; built once for a cell.

    Velocities are those of the unit ball of joint speeds, forces those of the torques that
    ``torque_scaling`` names.
    """

    def __init__(self, cell: Cell) -> None:
        """Build the functions of a posture."""
        system = cell.system
        ones = [np.ones(arm.n) for arm in cell.arms]
        velocity, force = ClosedChainVelocity(), ExternalForce()
        parts = [form.factor(system, T) for form in (velocity, force) for T in (ones, cell.scales)]
        torque_maps = [arm.J.T / T for arm, T in zip(system.arms, cell.scales, strict=True)]
        self._parts = Parts(
            system.q, system.object.parameters, [*parts, *torque_maps, *system.object.W]
        )

    def of(self, cell: Cell, joints: Sequence[Array]) -> dict[str, EllipsoidRecord]:
        """By name, with nulls where an arm is singular; joints by arm, (n_i,)."""
        values = self._parts(np.concatenate(joints), cell.parameters)
        velocity, scaled, averaged, force = (ellipsoid_of(factor) for factor in values[:4])
        K = len(cell.arms)
        internal = internal_force_factor(values[4 : 4 + K], values[4 + K :])
        found = {
            "closed-chain velocity": sliced(cell, velocity),
            "averaged velocity": sliced(cell, _polar(averaged)),
            "external force": sliced(cell, force),
            "external force, internal force optimal": sliced(cell, _polar(scaled)),
        }
        if internal.shape[1]:
            found["internal force"] = ellipsoid_of(internal)
        return {name: EllipsoidRecord.of(each) for name, each in found.items()}


def _polar(ellipsoid: Ellipsoid | None) -> Ellipsoid | None:
    return None if ellipsoid is None else polar(ellipsoid)
