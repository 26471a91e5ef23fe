"""What the torque limits of a cell allow at its postures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from copose.capability import ExactSet, forward_dynamics
from copose.capability.contact_limits import WrenchBounds, wrench_bounds
from copose.capability.torque_limits import Demand, Dynamics
from copose.kernels import Kernel
from copose.planning.cell import Cell
from copose.planning.parts import Parts
from copose.poses import Array

# What a torque may be over its limit, as a share of it, where an object is to be held.
HELD = 1e-6


@dataclass(frozen=True, eq=False)
class Holding:
    """An object in a place, and how the arms hold it: what a posture does not change.

    Attributes:
        motion: X_i by arm, see `Coupling`, (m, m).
        balance: P_i by arm, (b, m).
        turns: from root axes to world axes by arm, (m, m).
        falls: acceleration of free fall in root axes by arm, m/s², (3,).
        inertia: M_o, (m, m).
        mass: kg.
        weight: what holds the object against gravity, g_o, (b,).
    """

    motion: tuple[Array, ...]
    balance: tuple[Array, ...]
    turns: tuple[Array, ...]
    falls: tuple[Array, ...]
    inertia: Array
    mass: float
    weight: Array

    def acceleration(self, direction: Array) -> Demand:
        """The object is accelerated along a direction, (m,)."""
        return Demand.acceleration(direction, self.inertia, self.weight)

    def payload(self, acceleration: Array, *, still: bool = False) -> Demand:
        """Any mass of the same shape is accelerated so, (m,)."""
        per_kg = self.inertia / self.mass, self.weight / self.mass
        return Demand.payload(*per_kg, acceleration, still=still)

    @property
    def forces_alone(self) -> Holding:
        """The same where moments need not balance: what the paper's linear spaces mean."""
        m = len(self.inertia)
        cut = tuple(P[:m] for P in self.balance)
        return replace(self, balance=cut, weight=self.weight[:m])

    @property
    def hold(self) -> Demand:
        """The object is held at rest by arms at rest."""
        return Demand.holding(len(self.inertia), self.weight)


class Capacity:
    """Evaluates the equations of motion of one cell; built once.

    Attributes:
        limits: T by arm, (n,).
    """

    def __init__(self, cell: Cell, limits: Sequence[Array]) -> None:
        """Write down what is evaluated."""
        system = cell.system
        self.limits = tuple(limits)
        self._m, self._b = system.space.m, len(system.space.balance)
        fall = ca.SX.sym("fall", 3)
        kernels: dict[bytes, Kernel] = {}
        for arm in system.arms:
            if arm.arm.fingerprint not in kernels:
                parts = ca.vec(arm.M.T), ca.vec(arm.J_root.T), arm.weight_torques(fall)
                kernels[arm.arm.fingerprint] = Kernel(arm.q, fall, ca.vertcat(*parts))
        self.kernels = tuple(kernels.values())
        self._arms = tuple(kernels[arm.arm.fingerprint] for arm in system.arms)
        couplings = [system.coupling(i) for i in range(len(system.arms))]
        self._held = Parts(
            system.parameters,
            ca.SX(0, 1),
            [
                *(coupling.motion for coupling in couplings),
                *(coupling.balance for coupling in couplings),
                *(arm.R_world_root for arm in system.arms),
                *(coupling.fall for coupling in couplings),
                system.object.M_o,
            ],
        )
        gravity = ca.SX(ca.DM(system.gravity))
        self._accelerations = Kernel(
            system.q,
            system.parameters,
            ca.horzcat(*forward_dynamics(system, gravity, ca.SX.zeros(self._m))),
        )
        self.bounds: WrenchBounds = wrench_bounds(
            self.holding(cell).turns,
            system.space.linear,
            system.space.angular,
            [(arm.grip.force, arm.grip.moment) for arm in cell.problem.arms],
            cell.problem.constraints.internal_force,
        )

    def holding(self, cell: Cell) -> Holding:
        """Where a cell's object is, and how heavy."""
        *parts, inertia = self._held(cell.parameters, np.zeros(0))
        K, mass = len(self.limits), cell.problem.object.mass
        weight = np.zeros(self._b)
        fall = cell.system.gravity[: 2 if cell.problem.space.planar else 3]
        weight[: len(fall)] = -mass * fall
        motion, balance, turns, falls = (tuple(parts[k : k + K]) for k in range(0, 4 * K, K))
        falls = tuple(fall.ravel() for fall in falls)
        return Holding(motion, balance, turns, falls, inertia, mass, weight)

    def exact_set(self, cell: Cell, q: Sequence[Array], axes: Sequence[int]) -> ExactSet | None:
        """The accelerations, on these axes alone, of one posture at rest, by arm (n_i,).

        None where the equations of motion are singular.
        """
        values = self._accelerations(np.concatenate(q)[None], cell.parameters)[0]
        both = values.reshape(-1, self._m).T
        try:
            return ExactSet.of(both[:, :-1], np.concatenate(self.limits), both[:, -1], tuple(axes))
        except ValueError:
            return None

    def dynamics(self, holding: Holding, q: Sequence[Array], *, bounded: bool = True) -> Dynamics:
        """The equations of motion at postures, by arm (count, n_i).

        Args:
            holding: of the object.
            q: the postures.
            bounded: whether contact wrenches have limits.
        """
        M, J, g = [], [], []
        for kernel, fall, mine in zip(self._arms, holding.falls, q, strict=True):
            n, m = mine.shape[1], self._m
            values = kernel(mine, fall)
            M.append(values[:, : n * n].reshape(-1, n, n))
            J.append(values[:, n * n : n * n + m * n].reshape(-1, m, n))
            g.append(values[:, n * n + m * n :])
        bounds = self.bounds if bounded else self.bounds.none
        return Dynamics(
            tuple(M), tuple(J), tuple(g), holding.motion, holding.balance, self.limits, bounds
        )
