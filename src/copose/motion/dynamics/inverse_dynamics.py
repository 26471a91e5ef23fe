"""Inverse dynamics: joint torques and contact wrenches that carry the object along its path."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from copose.capability.torque_limits import Demand, Dynamics
from copose.cell.cell import Cell
from copose.cell.dynamics import HELD, CellDynamics
from copose.motion.path.knots import Course
from copose.poses import Array, Indices, Pose


@dataclass(frozen=True, eq=False)
class Carrying:
    """An inverse-dynamics problem: what a motion asks for at its knots."""

    course: Course  # at the knots
    load: Array  # force over moment that contact wrenches exert on the object, (n, b)
    J: Sequence[Array]  # Jacobians by arm, world axes, (n, m, n_i)
    alone: Sequence[Array]  # torques without wrenches by arm, (n, n_i)
    still: Sequence[Array]  # alike of arms at rest


class Torques:
    """Inverse dynamics of one cell along the object's path.

    Attributes:
        capacity: what torque limits allow, where they matter.
    """

    def __init__(self, cell: Cell, capacity: CellDynamics | None, tolerance: float = 1e-9) -> None:
        """Set up one cell.

        Args:
            cell: whose arms they are.
            capacity: what torque limits allow, where they matter.
            tolerance: relative error of a load beyond which no contact wrenches carry the object.
        """
        self._cell, self.capacity, self._tolerance = cell, capacity, tolerance

    def least(self, asked: Carrying) -> Array | None:
        """Torques of least ‖T⁻¹τ‖, T the limits or ones, (n, N); None where no wrenches carry the
        object.
        """
        limits = self._cell.torque_limits
        T = np.concatenate(limits or [np.ones(arm.n) for arm in self._cell.arms])
        count, K, m = len(asked.course), len(asked.J), self._cell.system.space.m
        wide = np.zeros((count, len(T), K * m))
        edges = np.cumsum([0, *(jacobian.shape[2] for jacobian in asked.J)]).tolist()
        for i, jacobian in enumerate(asked.J):
            wide[:, edges[i] : edges[i + 1], i * m : i * m + m] = jacobian.swapaxes(1, 2)
        alone = np.hstack(asked.alone)
        rotations = np.array([station.pose.rotation for station in asked.course.stations])
        P = np.concatenate(_balance(self._cell, rotations), axis=2)
        U, s, V = np.linalg.svd(P)
        # As an object turns the rank of what its contacts exert stays.
        rank = int((s[0] > self._tolerance * s[0, 0]).sum())
        exerted = (U[:, :, :rank].swapaxes(1, 2) @ asked.load[:, :, None]) / s[:, :rank, None]
        carried = V[:, :rank].swapaxes(1, 2) @ exerted
        missed = np.abs((P @ carried)[:, :, 0] - asked.load).max(axis=1)
        if np.any(missed > self._tolerance * (1 + np.abs(asked.load).max(axis=1))):
            return None
        inner = V[:, rank:].swapaxes(1, 2)
        pushed = (wide @ inner) / T[:, None]
        fixed = (alone[:, :, None] + wide @ carried) / T[:, None]
        rounding = max(pushed.shape[1:]) * np.finfo(float).eps
        wrenches = carried - inner @ (np.linalg.pinv(pushed, rcond=rounding) @ fixed)
        return np.asarray(alone + (wide @ wrenches)[:, :, 0])

    def uncarried(self, course: Course, *, moving: bool) -> int | None:
        """The first knot at which no contact wrenches, however large, carry the object at rest or,
        if ``moving``, as it moves; None where there is none.
        """
        E, balance = exertable(self._cell, self._tolerance), self._cell.system.space.balance
        loads = [self.loads(course, np.inf), *([self.inertial(course)] if moving else [])]
        for k, station in enumerate(course.stations):
            for load in loads:
                own = turn(station.pose, balance).T @ load[k]
                left = np.abs(own - E.T @ (E @ own)).max()
                if left > self._tolerance * (1 + np.abs(own).max()):
                    return k
        return None

    def limited(self, asked: Carrying, torques: Array) -> tuple[Array, Array]:
        """Torques, (n, N), brought within their limits where that can be, and shares of the limits
        whose largest is smallest, alike; ∞ where nothing within the limits of contact wrenches
        carries the object.
        """
        assert self.capacity is not None
        T = np.concatenate(self.capacity.limits)
        kept = self._kept(asked)
        over = (np.abs(torques) > T).any(axis=1)
        for k in np.flatnonzero(over & (np.abs(kept).max(axis=1) <= 1 + HELD)):
            torques[k] = _blended(torques[k] / T, kept[k]) * T
        return torques, np.abs(kept)

    def _kept(self, asked: Carrying) -> Array:
        """Torques over their limits, (n, N), whose largest is smallest; ∞ where there are none."""
        assert self.capacity is not None
        T = np.concatenate(self.capacity.limits)
        ratios = np.full((len(asked.course), len(T)), np.inf)
        for rows, dynamics, demand in self._alike(asked, asked.alone, asked.load):
            torques = dynamics.resting_torques(demand) / T
            sound = np.isfinite(torques).all(axis=1)
            ratios[rows[sound]] = torques[sound]
        return ratios

    def sparing(self, asked: Carrying) -> Array:
        """Contact wrenches, root axes, (n, Km), with which the largest share of a torque limit is
        smallest; NaN where there are none.
        """
        wrenches = np.empty((len(asked.course), len(asked.J) * self._cell.system.space.m))
        for rows, dynamics, demand in self._alike(asked, asked.alone, asked.load):
            wrenches[rows] = dynamics.resting(demand)
        return wrenches

    def least_stretch(self, asked: Carrying, least: float) -> float:
        """The least factor of the duration, ``least`` at least, with which torques keep limits; NaN
        where none is known to.
        """
        parts = self._alike(asked, asked.still, self.loads(asked.course, np.inf))
        squares = [dynamics.farthest(demand, least**-2).min() for _, dynamics, demand in parts]
        square = float(np.min(squares))
        return 1 / np.sqrt(square) if square > 0 else np.nan

    def _alike(
        self, asked: Carrying, fixed: Sequence[Array], load: Array
    ) -> Iterator[tuple[Indices, Dynamics, Demand]]:
        """Groups of knots where the object is turned alike, their equations of motion and demands:
        torques without wrenches and loads that are fixed, the rest in proportion to t.
        """
        capacity, space = self.capacity, self._cell.system.space
        assert capacity is not None
        turns = [turn(arm.base, space.rows) for arm in self._cell.arms]
        own = np.hstack(asked.alone) - np.hstack(fixed)
        alike: dict[bytes, list[int]] = {}
        for k, station in enumerate(asked.course.stations):
            alike.setdefault(station.pose.rotation.tobytes(), []).append(k)
        for rows in map(np.array, alike.values()):
            # Wrenches balance alike as long as the object does not turn.
            balance = _balance(self._cell, asked.course.stations[rows[0]].pose.rotation)
            dynamics = Dynamics(
                M=tuple(np.zeros((len(rows), len(T), len(T))) for T in capacity.limits),
                J=tuple(R.T @ jacobian[rows] for R, jacobian in zip(turns, asked.J, strict=True)),
                g=tuple(torque[rows] for torque in fixed),
                motion=tuple(np.zeros((space.m, space.m)) for _ in asked.J),
                balance=tuple(P @ R for P, R in zip(balance, turns, strict=True)),
                limits=capacity.limits,
                bounds=capacity.bounds,
            )
            demand = Demand.carrying(space.m, load[rows], (asked.load - load)[rows], own[rows])
            yield rows, dynamics, demand

    def inertial(self, course: Course) -> Array:
        """Inertial force and moment, by φ twice, in the rows of `Space.balance`, (n, b)."""
        thing, inertia = self._cell.problem.object, None
        if thing.inertia is not None:
            planar = self._cell.problem.space.planar
            inertia = np.array(thing.inertia) * (np.eye(3) if planar else 1.0)
        return course.inertial_loads(inertia)

    def loads(self, course: Course, duration: float) -> Array:
        """Force and moment of contacts on the object, in the rows of `Space.balance`, (n, b)."""
        thing, cell = self._cell.problem.object, self._cell
        loads = self.inertial(course) / duration**2
        rows = 2 if cell.problem.space.planar else 3
        loads[:, :rows] -= thing.mass * cell.system.gravity[:rows]
        return np.asarray(loads)


def exertable(cell: Cell, tolerance: float = 1e-9) -> Array:
    """Independent combinations of force and moment that the contacts can exert on the object, in
    its axes, (rank, b): a single hinge exerts no moment about itself.
    """
    P = np.hstack(_balance(cell, np.eye(3)))
    U, s, _ = np.linalg.svd(P)
    rank = int((s > tolerance * s[0]).sum())
    return np.eye(len(P)) if rank == len(P) else U[:, :rank].T


def _balance(cell: Cell, rotation: Array) -> list[Array]:
    """Maps of contact wrenches, world axes, to the balance of an object turned so, (b, m) each, or
    (n, b, m) of rotations (n, 3, 3).
    """
    space, maps = cell.system.space, []
    for arm in cell.arms:
        whole = np.tile(np.eye(6), (*rotation.shape[:-2], 1, 1))
        whole[..., 3:, :3] = -np.cross((rotation @ arm.grasp.position)[..., None, :], np.eye(3))
        maps.append(whole[..., np.array(space.balance)[:, None], list(space.rows)])
    return maps


def turn(frame: Pose, rows: Sequence[int]) -> Array:
    """The map of some rows of wrenches from the axes of a frame to the world's, (rows, rows)."""
    whole = np.zeros((6, 6))
    whole[:3, :3] = whole[3:, 3:] = frame.rotation
    return whole[np.ix_(rows, rows)]


def _blended(least: Array, kept: Array) -> Array:
    """Torques over limits of least norm, moved towards ones within them as far as is needed."""
    with np.errstate(divide="ignore", invalid="ignore"):
        part = (np.abs(least) - 1.0) / (np.abs(least) - np.sign(least) * kept)
    over = np.abs(least) > 1.0
    share = float(np.clip(part[over].max(initial=0.0), 0.0, 1.0)) if over.any() else 0.0
    return np.asarray(least + share * (kept - least))
