"""Joint speeds, accelerations and torques of a motion at its knots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from copose.cell.dynamics import CellDynamics
from copose.kernels import Kernel
from copose.motion.curve.differences import bends, slopes, spline_slopes
from copose.motion.curve.hermite import hermite_points
from copose.motion.dynamics.closing_slopes import closing_rates, within_speeds
from copose.motion.dynamics.inverse_dynamics import Carrying, Torques
from copose.motion.path.knots import Course, tip_goals
from copose.motion.path.object_motion import ObjectMotion
from copose.poses import Array
from copose.posture.model import PostureModel


@dataclass(frozen=True)
class DriveOptions:
    """Options of the rates of a motion."""

    opening: float = 0.3  # part of the tolerance beyond which slopes are bent to close the chain
    clips: int = 60  # steps back within speed limits, along more than one self-motion
    least_stretch: float = 1e-3  # of a duration, where neither speeds nor accelerations tell
    inside: float = 1e-4  # how far inside the limits these aim, relative


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
    """Rates and torques of one cell along the object's path by its equations of motion; built once.

    Attributes:
        capacity: what torque limits allow, where they matter.
        torques: finds torques.
    """

    def __init__(
        self,
        model: PostureModel,
        journey: ObjectMotion,
        tolerance: float,
        options: DriveOptions = DriveOptions(),
    ) -> None:
        """Write the equations of motion of every arm.

        Args:
            model: of the cell.
            journey: the object's.
            tolerance: what the chain may open between knots, m or rad.
            options: of the rates.
        """
        self._options = options
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
        velocities, accelerations, asked = self._asked(course, q, duration)
        torques = None if self._cell.weightless else self.torques.least(asked)
        if torques is None:
            return Driven(velocities, accelerations, None, None)
        shares = None
        if self._cell.dynamic_torque:
            torques, shares = self.torques.limited(asked, torques)
        edges = np.cumsum([joints.shape[1] for joints in q])[:-1]
        torque = tuple(np.split(torques, edges, axis=1))
        return Driven(velocities, accelerations, torque, shares)

    def least_duration(self, course: Course, q: Sequence[Array], duration: float) -> float:
        """The least duration in which a motion keeps limits of speeds, accelerations and torques,
        s, its rates at another given; NaN where none is known.
        """
        velocities, accelerations, asked = self._asked(course, q, duration)
        joints = [joint for arm in self._cell.arms for joint in arm.joints]
        speeds = np.abs(np.hstack(velocities)) / [joint.velocity for joint in joints]
        bends = np.abs(np.hstack(accelerations)) / [joint.acceleration for joint in joints]
        stretch = max(float(speeds.max()), float(np.sqrt(bends.max())), self._options.least_stretch)
        if self._cell.dynamic_torque:
            stretch = self.torques.least_stretch(asked, stretch)
        return duration * stretch

    def _asked(
        self, course: Course, q: Sequence[Array], duration: float
    ) -> tuple[tuple[Array, ...], tuple[Array, ...], Carrying]:
        """Joint velocities and accelerations of a motion, and what they ask of torques."""
        step = duration / (len(course) - 1)
        velocities, accelerations, jacobians, biases, still = [], [], [], [], []
        for i, (kernel, joints) in enumerate(zip(self._kernels, q, strict=True)):
            J, _, _, weight = self._parts(kernel, joints, np.zeros_like(joints))
            contact = course.velocities[i] / duration
            rate = self._rates(i, J, joints, step, contact)
            J, bend, M, bias = self._parts(kernel, joints, rate)
            contact = course.accelerations[i] / duration**2 - bend
            velocities.append(rate)
            accelerations.append(_nearest(J, bends(joints, step), contact))
            jacobians.append(J)
            biases.append((M @ accelerations[-1][:, :, None])[:, :, 0] + bias)
            still.append(weight)
        asked = Carrying(course, self.torques.loads(course, duration), jacobians, biases, still)
        return tuple(velocities), tuple(accelerations), asked

    def _rates(self, i: int, J: Array, q: Array, step: float, contact: Array) -> Array:
        """Slopes of the spline through the knots, on the chain and, if they can, within limits."""
        speeds = np.array([joint.velocity for joint in self._cell.arms[i].joints])
        rates = _nearest(J, spline_slopes(q, step), contact)
        rates[[0, -1]] = 0.0
        if len(q) > 2 and J.shape[2] == J.shape[1] + 1 and self._opens(i, q, rates, step):
            spare = np.linalg.qr(J.swapaxes(1, 2), mode="complete")[0][:, :, -1]
            rates = closing_rates(self._model, self._journey, i, q, rates, spare, step)
        over = np.flatnonzero((np.abs(rates) > speeds).any(axis=1))
        if len(over):
            rates[over] = self._within(J[over], rates[over], speeds)
        rates[[0, -1]] = 0.0
        return rates

    def _opens(self, i: int, q: Array, rates: Array, step: float) -> bool:
        """True where the chain opens by more than part of its tolerance between knots."""
        phases = (np.arange(len(q) - 1) + 0.5) / (len(q) - 1)
        goals = tip_goals(self._cell, self._journey, i, phases)
        residual, _ = self._model.arms[i].residual(hermite_points(q, rates, step, 0.5), goals)
        most = self._options.opening * self._tolerance
        return bool(np.linalg.norm(residual, axis=1).max(initial=0.0) > most)

    def _within(self, J: Array, rates: Array, speeds: Array) -> Array:
        """Rates, (count, n), moved along the self-motion to within limits where they can be."""
        m = J.shape[1]
        spare = np.linalg.qr(J.swapaxes(1, 2), mode="complete")[0][:, :, m:]
        most = (1 - self._options.inside) * speeds
        if spare.shape[2] == 1:
            return within_speeds(rates, spare[:, :, 0], speeds)
        moved = rates.copy()
        for _ in range(self._options.clips if spare.shape[2] else 0):
            if np.all(np.abs(moved) <= speeds):
                break
            # Twice as far as to the bounds, so as to arrive inside them.
            back = spare.swapaxes(1, 2) @ (moved - np.clip(moved, -most, most))[:, :, None]
            moved = moved - 2.0 * (spare @ back)[:, :, 0]
        return moved

    def wrenches(self, course: Course, q: Sequence[Array], duration: float) -> Array:
        """Contact wrenches at the knots of a motion that strain torque limits least, tip on object,
        root axes, (n, Km).
        """
        jacobians, biases = [], []
        for kernel, joints in zip(self._kernels, q, strict=True):
            step = duration / (len(course) - 1)
            J, _, M, bias = self._parts(kernel, joints, slopes(joints, step))
            jacobians.append(J)
            biases.append((M @ bends(joints, step)[:, :, None])[:, :, 0] + bias)
        loads = self.torques.loads(course, duration)
        return self.torques.sparing(Carrying(course, loads, jacobians, biases, biases))

    def _parts(self, kernel: Kernel, q: Array, rates: Array) -> tuple[Array, Array, Array, Array]:
        """Terms J, (count, m, n), J̇ q̇, (count, m), M, (count, n, n), and C q̇ + g, (count, n)."""
        m, n = self._cell.system.space.m, q.shape[1]
        values = kernel(np.hstack([q, rates]), np.zeros(0))
        J, bend, M, bias = np.split(values, np.cumsum([m * n, m, n * n]), axis=1)
        return J.reshape(-1, m, n), bend, M.reshape(-1, n, n), bias


def _nearest(J: Array, rates: Array, contact: Array) -> Array:
    """The rates nearest to some, (count, n), with J·rates a contact's, (count, m)."""
    missing = contact[:, :, None] - J @ rates[:, :, None]
    return np.asarray(rates + (np.linalg.pinv(J, rcond=1e-12) @ missing)[:, :, 0])
