"""What drives a motion: joint speeds, accelerations and torques at its knots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from copose.capability.torque_limits import Demand, Dynamics
from copose.kernels import Kernel
from copose.paths.course import Course, bends, slopes, spline_slopes
from copose.paths.interpolation import closing_slopes, goals, hermite, within_speeds
from copose.paths.journey import Journey
from copose.planning.capacity import HELD, Capacity
from copose.planning.machinery import Machinery
from copose.poses import Array, Pose

# Relative; beyond it no wrenches of the contacts carry the object.
_CARRIED = 1e-9
# The part of the tolerance from which on slopes are bent to close.
_PART = 0.3
# Steps back within speed limits, and how far inside they aim.
_CLIPS, _INSIDE = 60, 1 - 1e-7


@dataclass(frozen=True, eq=False)
class Driven:
    """Rates of a motion at its knots, by arm, (n, n_i) each.

    Attributes:
        velocities: rad/s or m/s, with J q̇ the contact's velocity.
        accelerations: alike, with J q̈ + J̇ q̇ the contact's acceleration.
        torques: N·m or N; None where no contact wrenches carry the object.
        share: the largest |τ|/T at its least, by knot, (n,); None where that is not asked.
    """

    velocities: tuple[Array, ...]
    accelerations: tuple[Array, ...]
    torques: tuple[Array, ...] | None
    share: Array | None


class Drive:
    """Evaluates the equations of motion of one cell along its courses; built once.

    Attributes:
        capacity: what torque limits allow, where they matter.
    """

    def __init__(self, machinery: Machinery, journey: Journey, tolerance: float) -> None:
        """Write down what is evaluated.

        Args:
            machinery: of the cell.
            journey: the object's.
            tolerance: what the chain may open between knots, m or rad.
        """
        self._cell = cell = machinery.cell
        self._machinery, self._journey, self._tolerance = machinery, journey, tolerance
        self.capacity = machinery.capacity
        if cell.problem.constraints.dynamic_torque and self.capacity is None:
            assert cell.torque_limits is not None
            self.capacity = Capacity(cell, cell.torque_limits)
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
        velocities, accelerations, inertias, jacobians, biases = [], [], [], [], []
        for i, (kernel, mine) in enumerate(zip(self._kernels, q, strict=True)):
            J, _, _, _ = self._parts(kernel, mine, np.zeros_like(mine))
            contact = course.velocities[i] / duration
            rate = self._rates(i, J, mine, step, contact)
            J, bend, M, bias = self._parts(kernel, mine, rate)
            contact = course.accelerations[i] / duration**2 - bend
            velocities.append(rate)
            accelerations.append(_nearest(J, bends(mine, step), contact))
            inertias.append(M)
            jacobians.append(J)
            biases.append((M @ accelerations[-1][:, :, None])[:, :, 0] + bias)
        load = self.loads(course, duration)
        found = self._least(course, load, jacobians, biases)
        if found is None:
            return Driven(tuple(velocities), tuple(accelerations), None, None)
        torques, _ = found
        share = None
        if self._cell.problem.constraints.dynamic_torque:
            torques, share = self._limited(course, load, jacobians, biases, torques)
        edges = np.cumsum([mine.shape[1] for mine in q])[:-1]
        torque = tuple(np.split(torques, edges, axis=1))
        return Driven(tuple(velocities), tuple(accelerations), torque, share)

    def _rates(self, i: int, J: Array, q: Array, step: float, contact: Array) -> Array:
        """Slopes of the spline through the knots, on the chain and, if they can, within limits."""
        speeds = np.array([joint.velocity for joint in self._cell.arms[i].joints])
        rates = _nearest(J, spline_slopes(q, step), contact)
        rates[[0, -1]] = 0.0
        if len(q) > 2 and J.shape[2] == J.shape[1] + 1 and self._opens(i, q, rates, step):
            spare = np.linalg.qr(J.swapaxes(1, 2), mode="complete")[0][:, :, -1]
            rates = closing_slopes(self._machinery, self._journey, i, q, rates, spare, step)
        over = np.flatnonzero((np.abs(rates) > speeds).any(axis=1))
        if len(over):
            rates[over] = _within(J[over], rates[over], speeds)
        rates[[0, -1]] = 0.0
        return rates

    def _opens(self, i: int, q: Array, rates: Array, step: float) -> bool:
        """Whether the chain comes near its tolerance between knots."""
        phases = (np.arange(len(q) - 1) + 0.5) / (len(q) - 1)
        there = goals(self._cell, self._journey, i, phases)
        residual, _ = self._machinery.arms[i].residual(hermite(q, rates, step, 0.5), there)
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
        found = self._least(course, self.loads(course, duration), jacobians, biases)
        if found is None:
            return np.full((len(course), len(q) * space.m), np.nan)
        parts = np.split(found[1], len(q), axis=1)
        turns = [_turn(arm.base, space.rows) for arm in self._cell.arms]
        return np.hstack([part @ turn for part, turn in zip(parts, turns, strict=True)])

    def _parts(self, kernel: Kernel, q: Array, rates: Array) -> tuple[Array, Array, Array, Array]:
        """J, (count, m, n), J̇ q̇, (count, m), M, (count, n, n), and C q̇ + g, (count, n)."""
        m, n = self._cell.system.space.m, q.shape[1]
        values = kernel(np.hstack([q, rates]), np.zeros(0))
        J, bend, M, bias = np.split(values, np.cumsum([m * n, m, n * n]), axis=1)
        return J.reshape(-1, m, n), bend, M.reshape(-1, n, n), bias

    def _least(
        self, course: Course, load: Array, J: Sequence[Array], torques: Sequence[Array]
    ) -> tuple[Array, Array] | None:
        """Torques of least ‖T⁻¹τ‖, (n, N), and their wrenches, world axes, (n, Km).

        Args:
            course: at the knots.
            load: what wrenches come to on the object, (n, b).
            J: Jacobians by arm, world axes, (n, m, n_i).
            torques: those without wrenches by arm, (n, n_i).
        """
        cell = self._cell
        limits = cell.torque_limits
        T = np.concatenate(limits or [np.ones(arm.n) for arm in cell.arms])
        count, K, m = len(course), len(J), cell.system.space.m
        wide = np.zeros((count, len(T), K * m))
        edges = np.cumsum([0, *(mine.shape[2] for mine in J)]).tolist()
        for i, mine in enumerate(J):
            wide[:, edges[i] : edges[i + 1], i * m : i * m + m] = mine.swapaxes(1, 2)
        alone = np.hstack(torques)
        wrenches = np.empty((count, K * m))
        for k in range(count):
            P = np.hstack(self._balance(course.stations[k].pose))
            U, s, V = np.linalg.svd(P)
            rank = int((s > _CARRIED * s[0]).sum())
            carried = V[:rank].T @ ((U[:, :rank].T @ load[k]) / s[:rank])
            if np.abs(P @ carried - load[k]).max() > _CARRIED * (1 + np.abs(load[k]).max()):
                return None
            inner = V[rank:].T
            pushed = (wide[k] @ inner) / T[:, None]
            fixed = (alone[k] + wide[k] @ carried) / T
            wrenches[k] = carried - inner @ np.linalg.lstsq(pushed, fixed, rcond=None)[0]
        return alone + (wide @ wrenches[:, :, None])[:, :, 0], wrenches

    def _limited(
        self,
        course: Course,
        load: Array,
        J: Sequence[Array],
        alone: Sequence[Array],
        torques: Array,
    ) -> tuple[Array, Array]:
        """Torques, (n, N), brought within their limits where that can be, and the largest share of
        a limit at its least, (n,).
        """
        assert self.capacity is not None
        T = np.concatenate(self.capacity.limits)
        share, kept = self._kept(course, J, alone, load)
        over = (np.abs(torques) > T).any(axis=1)
        for k in np.flatnonzero(over & (share <= 1 + HELD)):
            torques[k] = _blended(torques[k] / T, kept[k] / T) * T
        return torques, share

    def _kept(
        self, course: Course, J: Sequence[Array], torques: Sequence[Array], load: Array
    ) -> tuple[Array, Array]:
        """The largest share of a torque limit at its least, (n,), and such torques, (n, N)."""
        capacity, space = self.capacity, self._cell.system.space
        assert capacity is not None
        share, kept = np.empty(len(course)), np.empty((len(course), sum(map(len, capacity.limits))))
        turns = [_turn(arm.base, space.rows) for arm in self._cell.arms]
        for k, station in enumerate(course.stations):
            balance = self._balance(station.pose)
            dynamics = Dynamics(
                M=tuple(np.zeros((1, len(T), len(T))) for T in capacity.limits),
                J=tuple((turn.T @ mine[k])[None] for turn, mine in zip(turns, J, strict=True)),
                g=tuple(torque[k][None] for torque in torques),
                motion=tuple(np.zeros((space.m, space.m)) for _ in J),
                balance=tuple(P @ turn for P, turn in zip(balance, turns, strict=True)),
                limits=capacity.limits,
                bounds=capacity.bounds,
            )
            demand = Demand.holding(space.m, load[k])
            share[k] = dynamics.shares(demand)[0]
            if not np.isfinite(share[k]):
                share[k], kept[k] = np.inf, 0.0
                continue
            h = np.split(dynamics.resting(demand)[0], len(J))
            kept[k] = np.concatenate([
                g[0] + jacobian[0].T @ wrench
                for g, jacobian, wrench in zip(dynamics.g, dynamics.J, h, strict=True)
            ])  # fmt: skip
        return share, kept

    def inertial(self, course: Course) -> Array:
        """What moves the object, by φ twice, in the rows of `Space.balance`, (n, b)."""
        thing, inertia = self._cell.problem.object, None
        if thing.inertia is not None:
            planar = self._cell.problem.space.planar
            inertia = np.array(thing.inertia) * (np.eye(3) if planar else 1.0)
        return course.inertial_loads(inertia)

    def loads(self, course: Course, duration: float) -> Array:
        """What contact wrenches come to on the object, in the rows of `Space.balance`, (n, b)."""
        thing, cell = self._cell.problem.object, self._cell
        loads = self.inertial(course) / duration**2
        rows = 2 if cell.problem.space.planar else 3
        loads[:, :rows] -= thing.mass * cell.system.gravity[:rows]
        return np.asarray(loads)

    def _balance(self, pose: Pose) -> list[Array]:
        """Wrenches at the contacts, world axes, on the object, (b, m) each."""
        space, found = self._cell.system.space, []
        for arm in self._cell.arms:
            x, y, z = pose.rotation @ arm.grasp.position
            whole = np.eye(6)
            whole[3:, :3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
            found.append(whole[np.ix_(space.balance, space.rows)])
        return found


def _turn(base: Pose, rows: Sequence[int]) -> Array:
    """From root axes to world axes, (m, m)."""
    whole = np.zeros((6, 6))
    whole[:3, :3] = whole[3:, 3:] = base.rotation
    return whole[np.ix_(rows, rows)]


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


def _blended(least: Array, kept: Array) -> Array:
    """From torques of least norm, over limits, towards some that keep them, as far as needed."""
    with np.errstate(divide="ignore", invalid="ignore"):
        part = (np.abs(least) - 1.0) / (np.abs(least) - np.sign(least) * kept)
    over = np.abs(least) > 1.0
    share = float(np.clip(part[over].max(initial=0.0), 0.0, 1.0)) if over.any() else 0.0
    return np.asarray(least + share * (kept - least))
