"""Reach of limited torques, from sums over the arms: estimates for many postures at once.

The exact answers are linear programs, see `torque_limits`. Here the box of torques is taken for an
ellipsoid, which has closed forms.
"""

from __future__ import annotations

import math

import casadi as ca

from copose.capability.sums import Sums, symmetric, upper_triangle
from copose.capability.torque_maps import inertia_times_pinv, tip_inertia
from copose.mechanics import ArmMechanics, Coupling
from copose.poses import Array
from copose.problem import Space


class TorqueReach(Sums):
    """The effect of torques on the object: K τ = S a_o + r + [weight; 0], τ = T ξ.

    S = Σ P_iΛ_iX_i + [M_o; 0], (b, m), K = [… P_iΛ_iJ_iM_i⁻¹ …], (b, N), r = K g, (b,): the forward
    dynamics of the closed chain, and in the linear spaces the balance of moments too. The sums are
    S without the object, R = K T²Kᵀ and r.
    """

    uses = ("motion", "balance", "fall")

    def size(self, space: Space) -> int:
        """S, the upper triangle of R, and r."""
        b = len(space.balance)
        return b * space.m + b * (b + 1) // 2 + b

    def arm_terms(
        self, arm: ArmMechanics, coupling: Coupling, scale: Array | ca.SX
    ) -> tuple[ca.SX, ...]:
        """The terms from Λ = U⁻¹U⁻ᵀ and JM⁻¹ = UᵀPᵀ."""
        P, U = tip_inertia(arm)
        contact = ca.solve(U.T, coupling.balance.T).T
        K = contact @ P.T
        pushed = K * ca.repmat(scale.T, K.shape[0], 1)
        return (
            ca.vec(contact @ ca.solve(U.T, coupling.motion)),
            upper_triangle(pushed @ pushed.T),
            K @ arm.weight_torques(coupling.fall),
        )

    @staticmethod
    def farthest(sums: ca.SX, b: int, motion: ca.SX, load: ca.SX, n_torques: int) -> ca.SX:
        """The largest t with a_o = motion·[1, t], load·[1, t] on the object and ‖ξ‖ ≤ ρ.

        Args:
            sums: of all arms.
            b: rows of a balance.
            motion: (m, 2).
            load: (b, 2), or (m, 2) where moments need not balance.
            n_torques: N, see `_farthest`.
        """
        m, rows = motion.shape[0], list(range(load.shape[0]))
        S, R, r = ca.vertsplit(sums, [0, b * m, b * m + b * (b + 1) // 2, sums.numel()])
        needed = ca.reshape(S, b, m)[rows, :] @ motion + load
        fixed, slope = needed[:, 0] + r[rows], needed[:, 1]
        R = _ridged(symmetric(R, b)[rows, rows])
        D, LT, order = ca.ldl(R, False)
        both = ca.ldl_solve(ca.horzcat(slope, fixed), D, LT, order)
        A, B, C = ca.dot(slope, both[:, 0]), ca.dot(slope, both[:, 1]), ca.dot(fixed, both[:, 1])
        return _farthest(A, B, C, n_torques)


class HoldingTorque(Sums):
    """The least ‖T⁻¹τ‖ with which arms at rest hold a load, or arms that move with it.

    τ_i = D_iv + J_iᵀh_i, Σ P_ih_i = load: at rest D_i = g_i and v = 1; moving, with least-norm
    joint accelerations, D_i = [g_i, M_iJ_i⁺X_i] and v = [1; a_o]. With A_i = J_iT⁻²J_iᵀ and
    p_i = J_iT⁻²D_i the sums are Z = Σ P_iA_i⁻¹P_iᵀ, Y = Σ P_iA_i⁻¹p_i and
    C = Σ D_iᵀT⁻²D_i − p_iᵀA_i⁻¹p_i, and ‖T⁻¹τ‖² = vᵀC v + (load + Y v)ᵀZ⁻¹(load + Y v). The largest
    share of a torque limit is no larger than that norm, and no smaller than it over √N.
    """

    def __init__(self, *, moving: bool = False) -> None:
        """The sums of arms at rest, or of arms that move with the object."""
        self._moving = moving
        self.uses = ("motion", "balance", "fall") if moving else ("balance", "fall")

    def size(self, space: Space) -> int:
        """The upper triangle of Z, Y and the upper triangle of C."""
        b, d = len(space.balance), 1 + space.m * self._moving
        return b * (b + 1) // 2 + b * d + d * (d + 1) // 2

    def arm_terms(
        self, arm: ArmMechanics, coupling: Coupling, scale: Array | ca.SX
    ) -> tuple[ca.SX, ...]:
        """The terms from T⁻¹Jᵀ = Q U: A = UᵀU, p = UᵀQᵀT⁻¹D."""
        fixed = arm.weight_torques(coupling.fall)
        if self._moving:
            driven = inertia_times_pinv(arm.M, arm.J_root) @ coupling.motion
            fixed = ca.horzcat(fixed, driven)
        fixed = fixed / ca.repmat(scale, 1, fixed.shape[1])
        Q, U = ca.qr(arm.J_root.T / scale)
        contact = ca.solve(U.T, coupling.balance.T).T
        kept = Q.T @ fixed
        return (
            upper_triangle(contact @ contact.T),
            ca.vec(contact @ kept),
            upper_triangle(fixed.T @ fixed - kept.T @ kept),
        )

    @staticmethod
    def norm(sums: ca.SX, load: ca.SX) -> ca.SX:
        """The least ‖T⁻¹τ‖ for a load, (b,), of arms at rest."""
        _, _, square = _quadratic(sums, ca.horzcat(load, ca.SX(load.numel(), 1)), ca.SX(1))
        return ca.sqrt(ca.fmax(square, 0))

    @staticmethod
    def farthest(
        sums: ca.SX, load: ca.SX, n_torques: int, acceleration: ca.SX | None = None
    ) -> ca.SX:
        """The largest t with load·[1, t], (b, 2), held by ‖T⁻¹τ‖ ≤ ρ, see `_farthest`; a_o, (m,),
        of arms that move.
        """
        given = ca.SX(1) if acceleration is None else ca.vertcat(1, acceleration)
        return _farthest(*_quadratic(sums, load, given), n_torques)


def _quadratic(sums: ca.SX, load: ca.SX, v: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """A, B, C of ‖T⁻¹τ‖² = A t² + 2 B t + C at its least, for load·[1, t]."""
    b, d = load.shape[0], v.numel()
    edges = [0, b * (b + 1) // 2, b * (b + 1) // 2 + b * d, sums.numel()]
    Z, Y, own = ca.vertsplit(sums, edges)
    Z = _ridged(symmetric(Z, b))
    D, LT, order = ca.ldl(Z, False)
    fixed, slope = load[:, 0] + ca.reshape(Y, b, d) @ v, load[:, 1]
    both = ca.ldl_solve(ca.horzcat(slope, fixed), D, LT, order)
    alone = ca.dot(v, symmetric(own, d) @ v)
    return ca.dot(slope, both[:, 0]), ca.dot(slope, both[:, 1]), alone + ca.dot(fixed, both[:, 1])


def _ridged(matrix: ca.SX) -> ca.SX:
    """A positive definite matrix near one that may be singular."""
    entries = ca.diag(ca.diag(matrix))
    return matrix + 1e-12 * entries + 1e-16 * ca.trace(matrix) * ca.SX.eye(matrix.shape[0])


def _farthest(A: ca.SX, B: ca.SX, C: ca.SX, n_torques: int) -> ca.SX:
    """The largest t with A t² + 2 B t + C ≤ ρ².

    A box of N torques reaches, along a random direction, about as far as a ball of radius
    ρ = √(2N/π). Where no t is within it, the t that is nearest counts, less a fine: a
    thousand times what is beyond, in units of the reach.
    """
    lowest, square = C - B * B / A, 2 * n_torques / math.pi
    beyond = ca.sqrt(ca.fmax(lowest, square)) - math.sqrt(square)
    return -B / A + ca.sqrt(ca.fmax(square - lowest, 0) / A) - 1e3 * beyond / ca.sqrt(A)
