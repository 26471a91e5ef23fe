"""Extremes within torque limits: linear programs over joint accelerations and contact wrenches.

    τ_i = M_i q̈_i + g_i + J_iᵀh_i,  |τ_i| ≤ T_i,  J_i q̈_i = X_i a_o,  Σ P_ih_i = load

What is asked for is linear in one number t: an acceleration a_o = t u, or a load in proportion to
the object's mass. Internal force is whatever serves best, and so are joint accelerations unless a
`JointMotion` says which.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property

import numpy as np

from copose.capability.contact_limits import WrenchBounds
from copose.capability.linear_programs import maximise_first
from copose.poses import Array, Indices, Mask


@dataclass(frozen=True)
class RankOptions:
    """Tolerances of ranks, relative."""

    reached: float = 1e-9  # what a load or motion is missed by that counts as reached
    independent: float = 1e-9  # singular values that count as independent
    singular: float = 1e-12  # singular values of a Jacobian below are none


class JointMotion(Enum):
    """The joint accelerations that go with an acceleration of the object."""

    FREE = "any: null motion is whatever serves best"
    LEAST_NORM = "q̈_i = J_i⁺X_i a_o"
    REST = "none; the object is at rest"


@dataclass(frozen=True, eq=False)
class Demand:
    """A motion and a load that are demanded of the arms, in terms of a number t."""

    motion: Array  # a_o = motion·[1, t], (m, 2), or one for each of many postures, (count, m, 2)
    # What the contacts' wrenches come to on the object, load·[1, t], (b, 2), or alike; see
    # `Space.balance`.
    load: Array
    joints: JointMotion  # the joint accelerations
    # Torques that the arms' own motion takes, own·[1, t], (N, 2), or alike; none where it is None.
    own: Array | None = None

    @classmethod
    def each(cls, demands: Sequence[Demand]) -> Demand:
        """One for each of as many postures."""
        motion, load = ([getattr(d, part) for d in demands] for part in ("motion", "load"))
        return cls(np.array(motion), np.array(load), demands[0].joints)

    @classmethod
    def acceleration(cls, direction: Array, inertia: Array, weight: Array) -> Demand:
        """The object at t m/s² (or rad/s²) along a unit direction, and nothing else.

        Args:
            direction: u, (m,).
            inertia: M_o, (m, m).
            weight: what holds the object against gravity, g_o, (b,).
        """
        nothing = np.zeros(len(direction))
        load = _padded(inertia @ direction, len(weight))
        motion = np.column_stack([nothing, direction])
        return cls(motion, np.column_stack([weight, load]), JointMotion.FREE)

    @classmethod
    def payload(cls, inertia: Array, weight: Array, acceleration: Array) -> Demand:
        """An object of t kg that accelerates so with least-norm joint accelerations, or rests.

        Args:
            inertia: M_o per kg, (m, m).
            weight: g_o per kg, (b,).
            acceleration: a_o, (m,).
        """
        load = weight + _padded(inertia @ acceleration, len(weight))
        return cls(
            np.column_stack([acceleration, np.zeros(len(acceleration))]),
            np.column_stack([np.zeros(len(load)), load]),
            JointMotion.LEAST_NORM if acceleration.any() else JointMotion.REST,
        )

    @classmethod
    def holding(cls, m: int, weight: Array) -> Demand:
        """The object at rest in arms at rest, t without effect; weight g_o, (b,)."""
        load = np.column_stack([weight, np.zeros(len(weight))])
        return cls(np.zeros((m, 2)), load, JointMotion.REST)

    @classmethod
    def carrying(cls, m: int, weight: Array, inertial: Array, own: Array) -> Demand:
        """Objects in arms that move on given ways, t = 1/s² as fast, s the duration over a first.

        Args:
            m: of the task space.
            weight: g_o at every posture, (count, b).
            inertial: what wrenches come to besides at the first duration, (count, b).
            own: what torques joints take besides there, (count, N).
        """
        motion, load = np.zeros((len(own), m, 2)), np.stack([weight, inertial], axis=2)
        return cls(motion, load, JointMotion.REST, np.stack([0 * own, own], axis=2))


@dataclass(frozen=True, eq=False)
class Extreme:
    """An optimum of one posture."""

    value: float  # t
    torques: tuple[Array, ...]  # by arm, (n_i,)
    wrenches: tuple[Array, ...]  # h, tip on object, root axes, by arm, (m,)
    accelerations: tuple[Array, ...]  # q̈ by arm, (n_i,)


@dataclass(frozen=True, eq=False)
class Dynamics:
    """The equations of motion of many postures, arm by arm."""

    M: tuple[Array, ...]  # joint inertia, (count, n, n) each
    J: tuple[Array, ...]  # Jacobians in root axes, (count, m, n) each
    g: tuple[Array, ...]  # gravity torques, (count, n) each
    motion: tuple[Array, ...]  # X_i, (m, m) each
    balance: tuple[Array, ...]  # P_i, (b, m) each
    limits: tuple[Array, ...]  # T_i, (n,) each
    bounds: WrenchBounds  # on the contact wrenches
    ranks: RankOptions = RankOptions()  # tolerances

    @cached_property
    def _edges(self) -> tuple[int, ...]:
        """The columns where one arm's joints end among all of them."""
        return tuple(np.cumsum([len(T) for T in self.limits])[:-1])

    @property
    def n_joints(self) -> int:
        """N, of all arms."""
        return sum(len(T) for T in self.limits)

    def taken(self, rows: Indices) -> Dynamics:
        """Some of the postures, in some order."""
        return self.combined([rows] * len(self.M))

    def combined(self, rows: Sequence[Indices]) -> Dynamics:
        """Postures put together from the arms' own, by their numbers."""
        M, J, g = (
            tuple(part[own] for part, own in zip(parts, rows, strict=True))
            for parts in (self.M, self.J, self.g)
        )
        return replace(self, M=M, J=J, g=g)

    def farthest(self, demand: Demand, most: float = np.inf) -> Array:
        """The largest t of every posture, to 1e-9 of it, no more than ``most``, (count,).

        NaN where there is none, or where contacts cannot exert such loads by any torques.
        """
        x, _ = self._solved(demand, 1.0, most)
        return x[:, 0]

    def shares(self, demand: Demand, within: float = 1e-10) -> Array:
        """The largest |τ|/T at its least, at t = 0, about ``within`` of it, (count,).

        NaN where contacts cannot exert such loads by any torques.
        """
        x, _ = maximise_first(*self._shared(demand), within)
        return np.where(self._exertable(demand), -x[:, 0], np.nan)

    def quick_shares(self, demand: Demand, rows: Sequence[Indices]) -> Array:
        """An upper bound of `shares` of arms at rest, by torques of least ‖T⁻¹τ‖, (count,); ∞ where
        wrenches that go with them break their own limits.

        Args:
            demand: the same for all.
            rows: numbers of the arms' own postures, (count,) each.
        """
        particular, internal = self._distribution
        wrenches = np.hstack([particular @ demand.load[:, :1], internal])
        maps = []
        for i, own in enumerate(np.split(wrenches, len(self.J))):
            torque = self.J[i].swapaxes(1, 2) @ own
            torque[:, :, 0] += self.g[i]
            maps.append(torque / self.limits[i][:, None])
        both = list(zip(maps, rows, strict=True))
        # Squares are sums over the arms.
        squares = np.sum([(part.swapaxes(1, 2) @ part)[own] for part, own in both], axis=0)
        normal = squares[:, 1:, 1:]
        size = np.trace(normal, axis1=1, axis2=2)[:, None, None]
        normal = normal + (self.ranks.independent * size + 1e-300) * np.eye(normal.shape[1])
        x = np.ones((len(normal), wrenches.shape[1], 1))
        x[:, 1:] = _solved(normal, -squares[:, 1:, :1])
        shares = np.max([np.abs(part[own] @ x).max(axis=(1, 2)) for part, own in both], axis=0)
        held = self.bounds.matrix @ wrenches @ x
        sound = self._exertable(demand) & (held[:, :, 0] <= 1.0).all(axis=1)
        return np.where(sound, shares, np.inf)

    def inside(self, demand: Demand, part: float) -> tuple[Array, Array, Array]:
        """A start for programs: a demand met with a part of the torque limits.

        Returns:
            t, (count,), q̈, (count, N), and h, (count, Km), stacked over the arms; NaN where there
            is none.
        """
        x, (speeding, wrenches) = self._solved(demand, part)
        given = np.concatenate([np.ones((len(x), 1)), x], axis=1)[:, :, None]
        return x[:, 0], (speeding @ given)[:, :, 0], (wrenches @ given)[:, :, 0]

    def pulls(self, accelerations: Array) -> Array:
        """Stacked y, (count, Km), with least-norm joint accelerations q̈ = Jᵀy, (count, N)."""
        parts = zip(self.J, np.split(accelerations, self._edges, axis=1), strict=True)
        return np.hstack([(np.linalg.pinv(J.swapaxes(1, 2)) @ q[:, :, None])[:, :, 0]
                          for J, q in parts])  # fmt: skip

    def resting(self, demand: Demand) -> Array:
        """Wrenches h of the hold whose largest share is smallest, stacked, (count, Km)."""
        x, _ = maximise_first(*self._shared(demand))
        _, wrenches = self._maps(demand)
        given = np.concatenate([np.ones((len(x), 1)), 0 * x[:, :1], x[:, 1:]], axis=1)[:, :, None]
        return np.asarray((wrenches @ given)[:, :, 0])

    def resting_torques(self, demand: Demand) -> Array:
        """Torques of the hold whose largest share is smallest, stacked, (count, N)."""
        h = np.split(self.resting(demand), len(self.M), axis=1)
        parts = zip(self.g, self.J, h, strict=True)
        return np.hstack([g + (J.swapaxes(1, 2) @ own[:, :, None])[:, :, 0] for g, J, own in parts])

    def _maps(self, demand: Demand) -> tuple[Array, Array]:
        """q̈, (count, N, 2 + d), and h, (count, Km, 2 + d), as linear in (1, t, d free numbers)."""
        count, K, m = len(self.M[0]), len(self.M), self.motion[0].shape[0]
        particular, internal = self._distribution
        spare = [J.shape[2] - m if demand.joints is JointMotion.FREE else 0 for J in self.J]
        free = sum(spare) + internal.shape[1]
        wrenches = np.zeros((count, K * m, 2 + free))
        wrenches[:, :, :2] = particular @ demand.load
        wrenches[:, :, 2 + sum(spare) :] = internal
        speeding = np.zeros((count, sum(J.shape[2] for J in self.J), 2 + free))
        if demand.joints is not JointMotion.REST:
            row, column = 0, 2
            for J, X, d in zip(self.J, self.motion, spare, strict=True):
                Q, R = np.linalg.qr(J.swapaxes(1, 2), mode="complete")
                rows = slice(row, row + J.shape[2])
                least = _solved(R[:, :m].swapaxes(1, 2), X @ demand.motion)
                speeding[:, rows, :2] = Q[:, :, :m] @ least
                speeding[:, rows, column : column + d] = Q[:, :, m : m + d]
                row, column = rows.stop, column + d
        return speeding, wrenches

    def _torques(self, demand: Demand, speeding: Array, wrenches: Array) -> Array:
        """τ/T as linear in the same numbers, (count, N, 2 + d)."""
        rows, m = [], self.motion[0].shape[0]
        parts = np.split(speeding, self._edges, axis=1)
        for i, (M, J, g, T, part) in enumerate(
            zip(self.M, self.J, self.g, self.limits, parts, strict=True)
        ):
            torque = M @ part + J.swapaxes(1, 2) @ wrenches[:, m * i : m * i + m]
            torque[:, :, 0] += g
            rows.append(torque / T[:, None])
        torques = np.concatenate(rows, axis=1)
        if demand.own is not None:
            torques[:, :, :2] += demand.own / np.concatenate(self.limits)[:, None]
        return torques

    def _solved(
        self, demand: Demand, part: float, most: float = np.inf
    ) -> tuple[Array, tuple[Array, Array]]:
        speeding, wrenches = self._maps(demand)
        torques = self._torques(demand, speeding, wrenches)
        held = self.bounds.matrix @ wrenches
        A = np.concatenate([torques[:, :, 1:], -torques[:, :, 1:], held[:, :, 1:]], axis=1)
        b = np.concatenate(
            [part - torques[:, :, 0], part + torques[:, :, 0], 1.0 - held[:, :, 0]],
            axis=1,
        )
        if most < np.inf:
            # Over the bound: rows are to be of one size.
            last = np.zeros((len(A), 1, A.shape[2]))
            last[:, :, 0] = 1.0 / most
            A, b = np.concatenate([A, last], axis=1), np.hstack([b, np.ones((len(b), 1))])
        sound = np.isfinite(A).all(axis=(1, 2)) & np.isfinite(b).all(axis=1)
        sound &= self._exertable(demand)
        x = np.full((len(A), A.shape[2]), np.nan)
        if sound.any():
            x[sound] = maximise_first(A[sound], b[sound])[0]
        return x, (speeding, wrenches)

    def _shared(self, demand: Demand) -> tuple[Array, Array]:
        """The program whose first variable is minus the largest share."""
        speeding, wrenches = self._maps(demand)
        torques = self._torques(demand, speeding, wrenches)
        held = self.bounds.matrix @ wrenches
        A = np.concatenate([torques[:, :, 1:], -torques[:, :, 1:], held[:, :, 1:]], axis=1)
        A[:, :, 0] = 1.0
        A[:, 2 * torques.shape[1] :, 0] = 0.0
        b = [-torques[:, :, 0], torques[:, :, 0], 1.0 - held[:, :, 0]]
        return A, np.concatenate(b, axis=1)

    def _exertable(self, demand: Demand) -> Mask:
        """True where the contacts can exert such loads at all, for one or for each posture."""
        particular, _ = self._distribution
        missed = np.hstack(self.balance) @ particular @ demand.load - demand.load
        largest = np.abs(demand.load).max(axis=(-2, -1))
        return np.asarray(np.abs(missed).max(axis=(-2, -1)) <= self.ranks.reached * largest)

    @cached_property
    def _distribution(self) -> tuple[Array, Array]:
        """Shares of contacts in loads, (Km, b), and a basis of the internal wrenches, (Km, d)."""
        P = np.hstack(self.balance)
        U, s, V = np.linalg.svd(P)
        rank = int((s > self.ranks.independent * s[0]).sum())
        return V[:rank].T / s[:rank] @ U[:, :rank].T, V[rank:].T

    def extreme(self, demand: Demand, k: int = 0) -> Extreme | None:
        """The largest t of one posture with all its digits, or None where none is feasible."""
        return self._optimum(demand, k, shared=False)

    def hold(self, demand: Demand, k: int = 0) -> Extreme | None:
        """The hold of one posture whose largest share of a limit is smallest; t is that share."""
        return self._optimum(demand, k, shared=True)

    def _optimum(self, demand: Demand, k: int, *, shared: bool) -> Extreme | None:
        """The optimum by HiGHS (Q. Huangfu, J. A. J. Hall, 2018), in t, shares τ/T, and wrenches.

        Limits of whatever size are then ±1, and the rows of all equations of one size too.
        """
        from scipy.linalg import block_diag
        from scipy.optimize import linprog

        M, J = (block_diag(*(part[k] for part in parts)) for parts in (self.M, self.J))
        g, T = np.concatenate([part[k] for part in self.g]), np.concatenate(self.limits)
        P = np.hstack(self.balance)
        N, Km, b = len(M), len(J), len(P)
        reached = np.vstack(self.motion) @ demand.motion
        free, speeds = demand.joints is JointMotion.FREE, np.zeros((N, 2))
        if free:
            # J q̈ = X a_o with q̈ = M⁻¹(τ − g − Jᵀh).
            back = np.linalg.solve(M, J.T).T
            rows, right = [-reached[:, 1:], back * T, -back @ J.T], reached[:, 0] + back @ g
        else:
            # τ = M q̈ + g + Jᵀh with q̈ as the motion of the object has it.
            speeds[:] = np.linalg.lstsq(J, reached, rcond=self.ranks.singular)[0]
            if np.abs(J @ speeds - reached).max() > self.ranks.reached * np.abs(reached).max():
                return None
            inertial = M @ speeds
            rows, right = [-inertial[:, 1:], np.diag(T), -J.T], inertial[:, 0] + g
        balance = np.hstack([-demand.load[:, 1:], np.zeros((b, N)), P])
        right = np.concatenate([right, demand.load[:, 0]])
        bounds = self.bounds.matrix
        left, right, sizes = _evened(np.vstack([np.hstack(rows), balance]), right, bounds, N)
        # The least share is in proportion to what is to be held.
        whole = max(float(np.abs(right).max()), 1e-300) if shared else 1.0
        held = np.hstack([np.zeros((len(bounds), 1 + N)), bounds * sizes[1 + N :]])
        above, bound = [held], [np.full(len(bounds), 1 / whole)]
        limits = [(-np.inf, np.inf)] + [(-1.0, 1.0)] * N + [(-np.inf, np.inf)] * Km
        if shared:
            limits[1 : 1 + N] = [(-np.inf, np.inf)] * N
            left[:, 0] = 0.0
            for sign in (1.0, -1.0):
                rest = sign * np.eye(N), np.zeros((N, Km))
                above.append(np.hstack([np.full((N, 1), -1.0), *rest]))
                bound.append(np.zeros(N))
        cost = np.zeros(1 + N + Km)
        cost[0] = 1.0 if shared else -1.0
        optimum = linprog(
            cost, np.vstack(above), np.concatenate(bound), left, right / whole, limits,
            method="highs",
            options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
        )  # fmt: skip
        if optimum.x is None or not optimum.success:
            return None
        x = optimum.x * whole
        t, h = x[0] * (1.0 if shared else sizes[0]), x[1 + N :] * sizes[1 + N :]
        torques = x[1 : 1 + N] * T
        speeding = speeds @ [1.0, t]
        if free:
            speeding = np.linalg.solve(M, torques - g - J.T @ h)
        return Extreme(
            value=float(t) + 0.0,
            torques=tuple(np.split(torques, self._edges)),
            wrenches=tuple(np.split(h, len(self.M))),
            accelerations=tuple(np.split(speeding, self._edges)),
        )


def _evened(left: Array, right: Array, bounds: Array, shares: int) -> tuple[Array, Array, Array]:
    """Equations left·x = right in (t, shares, wrenches), each and each variable over its size.

    Args:
        left: (rows, 1 + shares + Km).
        right: (rows,).
        bounds: rows of bounds on the wrenches that are at most 1, (count, Km).
        shares: how many there are, whose size stays.

    Returns:
        Left and right sides, and the sizes of the variables, (1 + shares + Km,).
    """
    sizes, first = np.ones(left.shape[1]), 1 + shares
    pushed = np.abs(left[:, 1:first]).max(axis=1)
    pushed[pushed == 0.0] = np.inf
    largest = np.vstack([np.abs(left[:, first:]) / pushed[:, None], np.abs(bounds)]).max(axis=0)
    sizes[first:] = 1 / np.maximum(largest, 1e-300)
    scale = np.abs(left[:, 1:] * sizes[1:]).max(axis=1)
    scale[scale == 0.0] = 1.0
    left, right = left / scale[:, None], right / scale
    sizes[0] = 1 / max(float(np.abs(left[:, 0]).max()), 1e-300)
    return left * sizes, right, sizes


def _padded(vector: Array, size: int) -> Array:
    """A task vector in the rows of a balance: in the linear spaces it has no moment."""
    return np.concatenate([vector, np.zeros(size - len(vector))])


def _solved(matrices: Array, right: Array) -> Array:
    try:
        wide = np.broadcast_to(right, (len(matrices), *right.shape[-2:]))
        return np.asarray(np.linalg.solve(matrices, wide))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(matrices) @ right)
