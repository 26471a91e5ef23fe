"""What drives a motion: joint speeds, accelerations and torques at its knots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from copose.cell.dynamics import CellDynamics
from copose.kernels import Kernel
from copose.motion.curve.hermite import closing_slopes, goals, hermite, within_speeds
from copose.motion.dynamics.inverse_dynamics import Carrying, Torques, turn
from copose.motion.path.knots import Course, bends, slopes, spline_slopes
from copose.motion.path.object_motion import ObjectMotion
from copose.poses import Array
from copose.posture.model import PostureModel

# The part of the tolerance from which on slopes are bent to close.
_PART = 0.3
# Steps back within speed limits, and how far inside they aim.
_CLIPS, _INSIDE = 60, 1 - 1e-4


@dataclass(frozen=True, eq=False)
class Driven:
    """Rates of a motion at its knots, by arm, (n, n_i) each.

    Attributes:
        velocities: rad/s or m/s, with J q̇ the contact's velocity.
        accelerations: alike, with J q̈ + J̇ q̇ the contact's acceleration.
        torques: N·m or N; None where no contact wrenches carry the object, or inertia is not known.
        shares: |τ|/T of torques whose largest is smallest, (n, N); None where that is not asked.
    """

    velocities: tuple[Array, ...]
    accelerations: tuple[Array, ...]
    torques: tuple[Array, ...] | None
    shares: Array | None


class JointRates:
    """Evaluates the equations of motion of one cell along its courses; built once.

    Attributes:
        capacity: what torque limits allow, where they matter.
        torques: finds torques.
    """

    def __init__(self, model: PostureModel, journey: ObjectMotion, tolerance: float) -> None:
        """Write down what is evaluated.

        Args:
            model: of the cell.
            journey: the object's.
            tolerance: what the chain may open between knots, m or rad.
        """
        self._cell = cell = model.cell
        self._model, self._journey, self._tolerance = model, journey, tolerance
        self.capacity = model.capacity
        if cell.dynamic_torque and self.capacity is None:
            self.capacity = CellDynamics(cell, cell.counted_limits)
        self.torques = Torques(cell, self.capacity)
        gravity = ca.SX(ca.DM(cell.system.gravity))
        self._kernels = []
        for arm in cell.system.arms:
            rates = ca.SX.sym("rates", arm.arm.n)
            parts = (
                ca.vec(arm.J.T),
                arm.velocity_acceleration(rates),
                ca.vec(arm.M.T),
                arm.velocity_torques(rates) + arm.gravity_torques(gravity),
            )
            stacked = ca.vertcat(arm.q, rates)
            self._kernels.append(Kernel(stacked, ca.SX(0, 1), ca.vertcat(*parts)))

    @property
    def briskness(self) -> float:
        """A typical acceleration of the joint that limits hold back most, rad/s² or m/s²; ∞ where
        neither torques nor accelerations have limits to keep.
        """
        limits = [joint.acceleration for arm in self._cell.arms for joint in arm.joints]
        if self._cell.dynamic_torque:
            assert self.capacity is not None
            limits += self.capacity.sizes[0].tolist()
        return min(limits)

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """Everything that may be compiled."""
        return tuple(self._kernels)

    def driven(self, course: Course, q: Sequence[Array], duration: float) -> Driven:
        """The rates of a motion.

        Of all that move the contacts as the object does, the joint velocities nearest to the slopes
        of the spline through the knots and the accelerations nearest to second differences; of all
        torques that go with them those of least ‖T⁻¹τ‖, T the torque limits or ones, and where
        these break limits that are to be kept as little beside them as keeps them.

        Args:
            course: at the knots.
            q: joint positions by arm, (n, n_i).
            duration: s.
        """
        step = duration / (len(course) - 1)
        velocities, accelerations, jacobians, biases = [], [], [], []
        for i, (kernel, mine) in enumerate(zip(self._kernels, q, strict=True)):
            J, _, _, _ = self._parts(kernel, mine, np.zeros_like(mine))
            contact = course.velocities[i] / duration
            rate = self._rates(i, J, mine, step, contact)
            J, bend, M, bias = self._parts(kernel, mine, rate)
            contact = course.accelerations[i] / duration**2 - bend
            velocities.append(rate)
            accelerations.append(_nearest(J, bends(mine, step), contact))
            jacobians.append(J)
            biases.append((M @ accelerations[-1][:, :, None])[:, :, 0] + bias)
        asked = Carrying(course, self.torques.loads(course, duration), jacobians, biases)
        found = None if self._cell.weightless else self.torques.least(asked)
        if found is None:
            return Driven(tuple(velocities), tuple(accelerations), None, None)
        torques, _ = found
        shares = None
        if self._cell.dynamic_torque:
            torques, shares = self.torques.limited(asked, torques)
        edges = np.cumsum([mine.shape[1] for mine in q])[:-1]
        torque = tuple(np.split(torques, edges, axis=1))
        return Driven(tuple(velocities), tuple(accelerations), torque, shares)

    def _rates(self, i: int, J: Array, q: Array, step: float, contact: Array) -> Array:
        """Slopes of the spline through the knots, on the chain and, if they can, within limits."""
        speeds = np.array([joint.velocity for joint in self._cell.arms[i].joints])
        rates = _nearest(J, spline_slopes(q, step), contact)
        rates[[0, -1]] = 0.0
        if len(q) > 2 and J.shape[2] == J.shape[1] + 1 and self._opens(i, q, rates, step):
            spare = np.linalg.qr(J.swapaxes(1, 2), mode="complete")[0][:, :, -1]
            rates = closing_slopes(self._model, self._journey, i, q, rates, spare, step)
        over = np.flatnonzero((np.abs(rates) > speeds).any(axis=1))
        if len(over):
            rates[over] = _within(J[over], rates[over], speeds)
        rates[[0, -1]] = 0.0
        return rates

    def _opens(self, i: int, q: Array, rates: Array, step: float) -> bool:
        """Whether the chain comes near its tolerance between knots."""
        phases = (np.arange(len(q) - 1) + 0.5) / (len(q) - 1)
        there = goals(self._cell, self._journey, i, phases)
        residual, _ = self._model.arms[i].residual(hermite(q, rates, step, 0.5), there)
        return bool(np.linalg.norm(residual, axis=1).max(initial=0.0) > _PART * self._tolerance)

    def wrenches(self, course: Course, q: Sequence[Array], duration: float) -> Array:
        """Of the contacts at the knots of a motion, tip on object, root axes, (n, Km): a start."""
        space = self._cell.system.space
        jacobians, biases = [], []
        for kernel, mine in zip(self._kernels, q, strict=True):
            step = duration / (len(course) - 1)
            J, _, M, bias = self._parts(kernel, mine, slopes(mine, step))
            jacobians.append(J)
            biases.append((M @ bends(mine, step)[:, :, None])[:, :, 0] + bias)
        asked = Carrying(course, self.torques.loads(course, duration), jacobians, biases)
        found = self.torques.least(asked)
        if found is None:
            return np.full((len(course), len(q) * space.m), np.nan)
        parts = np.split(found[1], len(q), axis=1)
        turns = [turn(arm.base, space.rows) for arm in self._cell.arms]
        return np.hstack([part @ R for part, R in zip(parts, turns, strict=True)])

    def inertial(self, course: Course) -> Array:
        """See `Torques.inertial`."""
        return self.torques.inertial(course)

    def _parts(self, kernel: Kernel, q: Array, rates: Array) -> tuple[Array, Array, Array, Array]:
        """J, (count, m, n), J̇ q̇, (count, m), M, (count, n, n), and C q̇ + g, (count, n)."""
        m, n = self._cell.system.space.m, q.shape[1]
        values = kernel(np.hstack([q, rates]), np.zeros(0))
        J, bend, M, bias = np.split(values, np.cumsum([m * n, m, n * n]), axis=1)
        return J.reshape(-1, m, n), bend, M.reshape(-1, n, n), bias


def _nearest(J: Array, rates: Array, contact: Array) -> Array:
    """The rates nearest to some, (count, n), with J·rates a contact's, (count, m)."""
    missing = contact[:, :, None] - J @ rates[:, :, None]
    return np.asarray(rates + (np.linalg.pinv(J, rcond=1e-12) @ missing)[:, :, 0])


def _within(J: Array, rates: Array, speeds: Array) -> Array:
    """Rates, (count, n), moved along the self-motion to within limits where they can be."""
    m = J.shape[1]
    spare = np.linalg.qr(J.swapaxes(1, 2), mode="complete")[0][:, :, m:]
    most = _INSIDE * speeds
    if spare.shape[2] == 1:
        return within_speeds(rates, spare[:, :, 0], speeds)
    found = rates.copy()
    for _ in range(_CLIPS if spare.shape[2] else 0):
        if np.all(np.abs(found) <= speeds):
            break
        # Twice as far as to the bounds, so as to arrive inside them.
        back = spare.swapaxes(1, 2) @ (found - np.clip(found, -most, most))[:, :, None]
        found = found - 2.0 * (spare @ back)[:, :, 0]
    return found
