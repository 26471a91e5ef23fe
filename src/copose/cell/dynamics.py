"""The equations of motion of a cell with torque limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from copose.capability import ExactSet, forward_dynamics
from copose.capability.contact_limits import WrenchBounds, wrench_bounds
from copose.capability.torque_limits import Demand, Dynamics
from copose.cell.cell import Cell
from copose.cell.functions import PostureFunctions
from copose.kernels import Kernel
from copose.mechanics import ArmMechanics
from copose.poses import Array
from copose.robots import finite_range

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

    def payload(self, acceleration: Array) -> Demand:
        """Any mass of the same shape is accelerated so, (m,), or held at rest."""
        return Demand.payload(self.inertia / self.mass, self.weight / self.mass, acceleration)

    @property
    def forces_alone(self) -> Holding:
        """The object whose moments need not balance, as the paper's linear spaces mean it."""
        m = len(self.inertia)
        cut = tuple(P[:m] for P in self.balance)
        return replace(self, balance=cut, weight=self.weight[:m])

    @property
    def hold(self) -> Demand:
        """The object is held at rest by arms at rest."""
        return Demand.holding(len(self.inertia), self.weight)


class CellDynamics:
    """Evaluates the equations of motion of one cell; built once.

    Attributes:
        limits: T by arm, (n,).
        kernels: what evaluates them.
        bounds: on the contact wrenches.
        sizes: typical joint accelerations and contact wrenches by arm, such as torques of their
            limits' size make, by which programs scale their variables.
    """

    def __init__(self, cell: Cell, limits: Sequence[Array]) -> None:
        """Write down what is evaluated."""
        system = cell.system
        self.limits = tuple(limits)
        self._m, self._b = system.space.m, len(system.space.balance)
        fall = ca.SX.sym("fall", 3)

        def kernel(arm: ArmMechanics) -> Kernel:
            parts = ca.vec(arm.M.T), ca.vec(arm.J_root.T), arm.weight_torques(fall)
            return Kernel(arm.q, fall, ca.vertcat(*parts))

        self._arms = system.by_model(kernel)
        self.kernels = tuple(dict.fromkeys(self._arms))
        couplings = [system.coupling(i) for i in range(len(system.arms))]
        self._held = PostureFunctions(
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
        self.sizes = self._sizes(cell)
        # Measuring takes linear programs: loaded now they delay no answer that has to come at once.
        import scipy.optimize  # noqa: F401

    def _sizes(self, cell: Cell, postures: int = 8) -> tuple[Array, Array]:
        """The `sizes`, from some random postures of each arm."""
        rng, sizes = np.random.default_rng(0), []
        nothing = np.zeros(3)
        for arm, kernel, T in zip(cell.arms, self._arms, self.limits, strict=True):
            q = rng.uniform(*finite_range(arm.lower, arm.upper), (postures, arm.n))
            M, J, _ = _parts(kernel(q, nothing), arm.n, self._m)
            # Over the least limit, so that no square is out of range.
            shares = (part * (T.min() / T) for part in (M, J))
            norms = [np.sqrt(np.mean(np.square(part).sum(axis=2))) for part in shares]
            sizes.append([T.min() / max(float(norm), 1e-12) for norm in norms])
        fast, strong = np.array(sizes).T
        return fast, strong

    @property
    def strength(self) -> float:
        """A typical contact wrench of the weakest arm, N or N·m."""
        return float(min(self.sizes[1]))

    def holding(self, cell: Cell) -> Holding:
        """The object of a cell in its place."""
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

        They are ``bounded`` where contact wrenches have limits.
        """
        parts = []
        for kernel, fall, q_arm in zip(self._arms, holding.falls, q, strict=True):
            parts.append(_parts(kernel(q_arm, fall), q_arm.shape[1], self._m))
        M, J, g = zip(*parts, strict=True)
        bounds = self.bounds if bounded else self.bounds.none
        return Dynamics(M, J, g, holding.motion, holding.balance, self.limits, bounds)

    def resting(self, holding: Holding, q: Sequence[Array]) -> Array:
        """Starts of variables that hold an object, see `StaticTorque.term`, (count, Km)."""
        wrenches = self.dynamics(holding, q).resting(holding.hold)
        return wrenches / np.repeat(self.sizes[1], self._m)


def _parts(values: Array, n: int, m: int) -> tuple[Array, Array, Array]:
    """M, J and g of what a kernel says of postures, (count, n² + m n + n)."""
    M, J, g = np.split(values, [n * n, n * n + m * n], axis=1)
    return M.reshape(-1, n, n), J.reshape(-1, m, n), g
