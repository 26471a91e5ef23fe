"""What torque limits allow, exactly: linear programs over joint accelerations and contact wrenches.

    τ_i = M_i q̈_i + g_i + J_iᵀh_i,  |τ_i| ≤ T_i,  J_i q̈_i = X_i a_o,  Σ P_ih_i = load

What is asked for is linear in one number t: an acceleration a_o = t u, or a load in proportion to
the object's mass. Null motion and internal force are whatever serves best.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from copose.capability.contact_limits import WrenchBounds
from copose.capability.linear_programs import TOLERANCE, maximise_first
from copose.poses import Array, Indices, Mask

_RANK = 1e-9


@dataclass(frozen=True, eq=False)
class Demand:
    """What the arms are to do, in terms of a number t.

    Attributes:
        motion: a_o = motion·[1, t], (m, 2), or one for each of many postures, (count, m, 2).
        load: what the contacts' wrenches come to on the object, load·[1, t], (b, 2), or alike; see
            `Space.balance`.
        still: whether the arms are at rest too, q̈ = 0.
    """

    motion: Array
    load: Array
    still: bool = False

    @classmethod
    def each(cls, demands: Sequence[Demand]) -> Demand:
        """One for each of as many postures."""
        motion, load = ([getattr(d, part) for d in demands] for part in ("motion", "load"))
        return cls(np.array(motion), np.array(load), demands[0].still)

    @classmethod
    def acceleration(cls, direction: Array, inertia: Array, weight: Array) -> Demand:
        """T m/s² (or rad/s²) along a unit direction, and nothing else.

        Args:
            direction: u, (m,).
            inertia: M_o, (m, m).
            weight: what holds the object against gravity, g_o, (b,).
        """
        nothing = np.zeros(len(direction))
        load = _padded(inertia @ direction, len(weight))
        return cls(np.column_stack([nothing, direction]), np.column_stack([weight, load]))

    @classmethod
    def payload(
        cls, inertia: Array, weight: Array, acceleration: Array, *, still: bool = False
    ) -> Demand:
        """T kg that accelerate so.

        Args:
            inertia: M_o per kg, (m, m).
            weight: g_o per kg, (b,).
            acceleration: a_o, (m,).
            still: whether the arms are at rest.
        """
        load = weight + _padded(inertia @ acceleration, len(weight))
        return cls(
            np.column_stack([acceleration, np.zeros(len(acceleration))]),
            np.column_stack([np.zeros(len(load)), load]),
            still,
        )

    @classmethod
    def holding(cls, m: int, weight: Array) -> Demand:
        """The object at rest in arms at rest, t without effect; weight g_o, (b,)."""
        return cls(np.zeros((m, 2)), np.column_stack([weight, np.zeros(len(weight))]), still=True)


@dataclass(frozen=True, eq=False)
class Extreme:
    """An optimum of one posture.

    Attributes:
        value: t.
        torques: by arm, (n_i,).
        wrenches: h, tip on object, root axes, by arm, (m,).
        accelerations: q̈ by arm, (n_i,).
    """

    value: float
    torques: tuple[Array, ...]
    wrenches: tuple[Array, ...]
    accelerations: tuple[Array, ...]


@dataclass(frozen=True, eq=False)
class Dynamics:
    """The equations of motion of many postures, arm by arm.

    Attributes:
        M: joint inertia, (count, n, n) each.
        J: Jacobians in root axes, (count, m, n) each.
        g: gravity torques, (count, n) each.
        motion: X_i, (m, m) each.
        balance: P_i, (b, m) each.
        limits: T_i, (n,) each.
        bounds: on the contact wrenches.
    """

    M: tuple[Array, ...]
    J: tuple[Array, ...]
    g: tuple[Array, ...]
    motion: tuple[Array, ...]
    balance: tuple[Array, ...]
    limits: tuple[Array, ...]
    bounds: WrenchBounds
    _edges: tuple[int, ...] = field(init=False)

    def __post_init__(self) -> None:
        """Where one arm's joints end among all of them."""
        object.__setattr__(self, "_edges", tuple(np.cumsum([len(T) for T in self.limits])[:-1]))

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
            tuple(part[mine] for part, mine in zip(parts, rows, strict=True))
            for parts in (self.M, self.J, self.g)
        )
        return replace(self, M=M, J=J, g=g)

    def farthest(self, demand: Demand) -> Array:
        """The largest t of every posture, to 1e-9 of it, (count,).

        NaN where there is none, or where contacts cannot exert such loads by any torques.
        """
        x, _ = self._solved(demand, 1.0)
        return x[:, 0]

    def shares(self, demand: Demand, within: float = TOLERANCE) -> Array:
        """The largest |τ|/T at its least, at t = 0, about ``within`` of it, (count,).

        NaN where contacts cannot exert such loads by any torques.
        """
        x, _ = maximise_first(*self._shared(demand), within)
        return np.where(self._exertable(demand), -x[:, 0], np.nan)

    def quick_shares(self, demand: Demand) -> Array:
        """What `shares` is at most, by torques of least ‖T⁻¹τ‖, (count,); ∞ where wrenches that go
        with them break their own limits.
        """
        speeding, wrenches = self._maps(demand)
        torques = self._torques(speeding, wrenches)
        free, fixed = torques[:, :, 2:], torques[:, :, :1]
        normal = free.swapaxes(1, 2) @ free
        size = np.trace(normal, axis1=1, axis2=2)[:, None, None]
        normal += (_RANK * size + np.finfo(float).tiny) * np.eye(free.shape[2])
        x = _solved(normal, -free.swapaxes(1, 2) @ fixed)
        share = np.abs(fixed + free @ x)[:, :, 0].max(axis=1)
        held = self.bounds.matrix @ (wrenches[:, :, :1] + wrenches[:, :, 2:] @ x)
        sound = self._exertable(demand) & (held[:, :, 0] <= self.bounds.bound).all(axis=1)
        return np.where(sound, share, np.inf)

    def inside(self, demand: Demand, part: float) -> tuple[Array, Array, Array]:
        """T, q̈ and h of a demand met with a part of the torque limits: a place to start from.

        Returns:
            t, (count,), q̈, (count, N), and h, (count, Km), stacked over the arms; NaN where there
            is none.
        """
        x, (speeding, wrenches) = self._solved(demand, part)
        given = np.concatenate([np.ones((len(x), 1)), x], axis=1)[:, :, None]
        return x[:, 0], (speeding @ given)[:, :, 0], (wrenches @ given)[:, :, 0]

    def resting(self, demand: Demand) -> Array:
        """H of the hold whose largest share is smallest, stacked, (count, Km)."""
        x, _ = maximise_first(*self._shared(demand))
        _, wrenches = self._maps(demand)
        given = np.concatenate([np.ones((len(x), 1)), 0 * x[:, :1], x[:, 1:]], axis=1)[:, :, None]
        return np.asarray((wrenches @ given)[:, :, 0])

    def resting_torques(self, demand: Demand) -> Array:
        """Torques of the hold whose largest share is smallest, stacked, (count, N)."""
        h = np.split(self.resting(demand), len(self.M), axis=1)
        parts = zip(self.g, self.J, h, strict=True)
        return np.hstack(
            [g + (J.swapaxes(1, 2) @ mine[:, :, None])[:, :, 0] for g, J, mine in parts]
        )

    def _maps(self, demand: Demand) -> tuple[Array, Array]:
        """q̈, (count, N, 2 + d), and h, (count, Km, 2 + d), as linear in (1, t, d free numbers)."""
        count, K, m = len(self.M[0]), len(self.M), self.motion[0].shape[0]
        particular, internal = self._distribution
        spare = [0 if demand.still else J.shape[2] - m for J in self.J]
        free = sum(spare) + internal.shape[1]
        wrenches = np.zeros((count, K * m, 2 + free))
        wrenches[:, :, :2] = particular @ demand.load
        wrenches[:, :, 2 + sum(spare) :] = internal
        speeding = np.zeros((count, sum(J.shape[2] for J in self.J), 2 + free))
        if not demand.still:
            row, column = 0, 2
            for J, X, d in zip(self.J, self.motion, spare, strict=True):
                Q, R = np.linalg.qr(J.swapaxes(1, 2), mode="complete")
                rows = slice(row, row + J.shape[2])
                least = _solved(R[:, :m].swapaxes(1, 2), X @ demand.motion)
                speeding[:, rows, :2] = Q[:, :, :m] @ least
                speeding[:, rows, column : column + d] = Q[:, :, m:]
                row, column = rows.stop, column + d
        return speeding, wrenches

    def _torques(self, speeding: Array, wrenches: Array) -> Array:
        """τ/T as linear in the same numbers, (count, N, 2 + d)."""
        rows, m = [], self.motion[0].shape[0]
        parts = np.split(speeding, self._edges, axis=1)
        for i, (M, J, g, T, part) in enumerate(
            zip(self.M, self.J, self.g, self.limits, parts, strict=True)
        ):
            torque = M @ part + J.swapaxes(1, 2) @ wrenches[:, m * i : m * i + m]
            torque[:, :, 0] += g
            rows.append(torque / T[:, None])
        return np.concatenate(rows, axis=1)

    def _solved(self, demand: Demand, part: float) -> tuple[Array, tuple[Array, Array]]:
        speeding, wrenches = self._maps(demand)
        torques = self._torques(speeding, wrenches)
        held = self.bounds.matrix @ wrenches
        A = np.concatenate([torques[:, :, 1:], -torques[:, :, 1:], held[:, :, 1:]], axis=1)
        b = np.concatenate(
            [part - torques[:, :, 0], part + torques[:, :, 0], self.bounds.bound - held[:, :, 0]],
            axis=1,
        )
        sound = np.isfinite(A).all(axis=(1, 2)) & np.isfinite(b).all(axis=1)
        sound &= self._exertable(demand)
        x = np.full((len(A), A.shape[2]), np.nan)
        if sound.any():
            x[sound] = maximise_first(A[sound], b[sound])[0]
        return x, (speeding, wrenches)

    def _shared(self, demand: Demand) -> tuple[Array, Array]:
        """The program whose first variable is minus the largest share."""
        speeding, wrenches = self._maps(demand)
        torques = self._torques(speeding, wrenches)
        held = self.bounds.matrix @ wrenches
        A = np.concatenate([torques[:, :, 1:], -torques[:, :, 1:], held[:, :, 1:]], axis=1)
        A[:, :, 0] = 1.0
        A[:, 2 * torques.shape[1] :, 0] = 0.0
        b = [-torques[:, :, 0], torques[:, :, 0], self.bounds.bound - held[:, :, 0]]
        return A, np.concatenate(b, axis=1)

    def _exertable(self, demand: Demand) -> Mask:
        """Whether the contacts can exert such loads at all, for one or for each posture."""
        particular, _ = self._distribution
        missed = np.hstack(self.balance) @ particular @ demand.load - demand.load
        largest = np.abs(demand.load).max(axis=(-2, -1))
        return np.asarray(np.abs(missed).max(axis=(-2, -1)) <= _RANK * (1 + largest))

    @cached_property
    def _distribution(self) -> tuple[Array, Array]:
        """How contacts share loads, (Km, b), and a basis of the internal wrenches, (Km, d)."""
        P = np.hstack(self.balance)
        U, s, V = np.linalg.svd(P)
        rank = int((s > _RANK * s[0]).sum())
        return V[:rank].T / s[:rank] @ U[:, :rank].T, V[rank:].T

    def extreme(self, demand: Demand, k: int = 0) -> Extreme | None:
        """The largest t of one posture with all its digits, or None where none is feasible."""
        return self._optimum(demand, k, shared=False)

    def hold(self, demand: Demand, k: int = 0) -> Extreme | None:
        """The hold of one posture whose largest share of a limit is smallest; t is that share."""
        return self._optimum(demand, k, shared=True)

    def _optimum(self, demand: Demand, k: int, *, shared: bool) -> Extreme | None:
        """By HiGHS (Q. Huangfu, J. A. J. Hall, 2018), in all unknowns: no pseudoinverse.

        Unknowns are t, the joint accelerations over a typical size of theirs, and the wrenches.
        """
        from scipy.linalg import block_diag
        from scipy.optimize import linprog

        M, J = (block_diag(*(part[k] for part in parts)) for parts in (self.M, self.J))
        g, T = np.concatenate([part[k] for part in self.g]), np.concatenate(self.limits)
        X, P = np.vstack(self.motion), np.hstack(self.balance)
        N, Km, b = len(M), len(J), len(P)
        quick = np.maximum(np.abs(np.diag(M)), 1e-12)
        torque = np.hstack([np.zeros((N, 1)), M / quick, J.T]) / T[:, None]
        held = np.hstack([np.zeros((len(self.bounds.bound), 1 + N)), self.bounds.matrix])
        upper, lower = torque.copy(), -torque
        right = np.concatenate([np.full(2 * N, 0.0 if shared else 1.0), self.bounds.bound])
        right[:N] -= g / T
        right[N : 2 * N] += g / T
        if shared:
            upper[:, 0] = lower[:, 0] = -1.0
        together = np.zeros((Km + b, 1 + N + Km))
        together[:Km, 1 : 1 + N] = J / quick
        together[Km:, 1 + N :] = P
        wanted = np.concatenate([X @ demand.motion[:, 0], demand.load[:, 0]])
        if not shared:
            together[:, 0] = -np.concatenate([X @ demand.motion[:, 1], demand.load[:, 1]])
        free: list[tuple[float, float]] = [(-np.inf, np.inf)] * (1 + N + Km)
        if demand.still:
            free[1 : 1 + N] = [(0.0, 0.0)] * N
            together, wanted = together[Km:], wanted[Km:]
        cost = np.zeros(1 + N + Km)
        cost[0] = 1.0 if shared else -1.0
        found = linprog(
            cost, np.vstack([upper, lower, held]), right, together, wanted, free,
            method="highs",
            options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
        )  # fmt: skip
        if found.x is None or not found.success:
            return None
        speeds, h = found.x[1 : 1 + N] / quick, found.x[1 + N :]
        return Extreme(
            value=float(found.x[0]) + 0.0,
            torques=tuple(np.split(M @ speeds + g + J.T @ h, self._edges)),
            wrenches=tuple(np.split(h, len(self.M))),
            accelerations=tuple(np.split(speeds, self._edges)),
        )


def _padded(vector: Array, size: int) -> Array:
    """A task vector in the rows of a balance: in the linear spaces it has no moment."""
    return np.concatenate([vector, np.zeros(size - len(vector))])


def _solved(matrices: Array, right: Array) -> Array:
    try:
        wide = np.broadcast_to(right, (len(matrices), *right.shape[-2:]))
        return np.asarray(np.linalg.solve(matrices, wide))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(matrices) @ right)
