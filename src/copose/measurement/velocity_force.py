"""The velocity and force ellipsoids of one posture, as a result states them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from copose.capability import ClosedChainVelocity, Ellipsoid, ExternalForce
from copose.capability.companions import internal_force_factor, polar
from copose.cell.cell import Cell
from copose.cell.functions import PostureFunctions, ellipsoid_of, sliced
from copose.poses import Array
from copose.results import CompanionRecord


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
        self._parts = PostureFunctions(
            system.q, system.parameters, [*parts, *torque_maps, *system.object.W]
        )

    def of(self, cell: Cell, joints: Sequence[Array]) -> dict[str, CompanionRecord]:
        """The ellipsoids by name, with nulls where an arm is singular; joints by arm, (n_i,)."""
        values = self._parts(np.concatenate(joints), cell.parameters)
        velocity, scaled, averaged, force = (ellipsoid_of(factor) for factor in values[:4])
        K = len(cell.arms)
        internal = internal_force_factor(values[4 : 4 + K], values[4 + K :])
        ellipsoids = {
            "closed-chain velocity": sliced(cell, velocity),
            "averaged velocity": sliced(cell, _polar(averaged)),
            "external force": sliced(cell, force),
            "external force, internal force optimal": sliced(cell, _polar(scaled)),
        }
        problem = cell.problem
        named = [np.array(problem.along(u))[None] for u in problem.objective.wanted]
        axes = np.vstack([np.eye(len(problem.axes)), *named])
        records = {name: CompanionRecord.of_directions(e, axes) for name, e in ellipsoids.items()}
        if internal.shape[1]:
            directions = np.eye(internal.shape[1])
            force = ellipsoid_of(internal)
            records["internal force"] = CompanionRecord.of_directions(force, directions)
        return records


def _polar(ellipsoid: Ellipsoid | None) -> Ellipsoid | None:
    return None if ellipsoid is None else polar(ellipsoid)
