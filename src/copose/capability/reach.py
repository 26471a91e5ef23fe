"""How far limited torques reach, from sums over the arms: estimates for many postures at once.

The exact answers are linear programs, see `torque_limits`. Here the box of torques is taken for an
ellipsoid, which has closed forms.
"""

from __future__ import annotations

import math

import casadi as ca

from copose.capability.resolutions import tip_inertia
from copose.capability.sums import Sums, symmetric, upper_triangle
from copose.mechanics import ArmMechanics, Coupling
from copose.poses import Array
from copose.problem import Space

# What is beyond reach counts as worse by this much, in units of the reach.
_BEYOND = 1e3
_RIDGE = 1e-10


class TorqueReach(Sums):
    """What torques do to the object: K τ = S a_o + r + [weight; 0], τ = T ξ.

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
        """From Λ = U⁻¹U⁻ᵀ and JM⁻¹ = UᵀPᵀ."""
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
        R = symmetric(R, b)[rows, rows]
        R += _RIDGE * ca.trace(R) * ca.SX.eye(len(rows))
        D, LT, order = ca.ldl(R, False)
        both = ca.ldl_solve(ca.horzcat(slope, fixed), D, LT, order)
        A, B, C = ca.dot(slope, both[:, 0]), ca.dot(slope, both[:, 1]), ca.dot(fixed, both[:, 1])
        return _farthest(A, B, C, n_torques)


class HoldingTorque(Sums):
    """The least ‖T⁻¹τ‖ with which arms at rest hold a load.

    τ_i = g_i + J_iᵀh_i, Σ P_ih_i = load. With A_i = J_iT⁻²J_iᵀ and p_i = J_iT⁻²g_i the sums are
    Z = Σ P_iA_i⁻¹P_iᵀ, y = Σ P_iA_i⁻¹p_i and k = Σ ‖T⁻¹g_i‖² − p_iᵀA_i⁻¹p_i, and
    ‖T⁻¹τ‖² = k + (load + y)ᵀZ⁻¹(load + y). The largest share of a torque limit is no larger than
    that norm, and no smaller than it over √N.
    """

    uses = ("balance", "fall")

    def size(self, space: Space) -> int:
        """The upper triangle of Z, y and k."""
        b = len(space.balance)
        return b * (b + 1) // 2 + b + 1

    def arm_terms(
        self, arm: ArmMechanics, coupling: Coupling, scale: Array | ca.SX
    ) -> tuple[ca.SX, ...]:
        """From T⁻¹Jᵀ = Q U: A = UᵀU, p = UᵀQᵀT⁻¹g."""
        weight = arm.weight_torques(coupling.fall) / scale
        Q, U = ca.qr(arm.J_root.T / scale)
        contact = ca.solve(U.T, coupling.balance.T).T
        kept = Q.T @ weight
        return (
            upper_triangle(contact @ contact.T),
            contact @ kept,
            ca.dot(weight, weight) - ca.dot(kept, kept),
        )

    @staticmethod
    def norm(sums: ca.SX, load: ca.SX) -> ca.SX:
        """The least ‖T⁻¹τ‖ for a load, (b,)."""
        _, _, square = _quadratic(sums, ca.horzcat(load, ca.SX(load.numel(), 1)))
        return ca.sqrt(ca.fmax(square, 0))

    @staticmethod
    def farthest(sums: ca.SX, load: ca.SX, n_torques: int) -> ca.SX:
        """The largest t with load·[1, t], (b, 2), held by ‖T⁻¹τ‖ ≤ ρ, see `_farthest`."""
        return _farthest(*_quadratic(sums, load), n_torques)


def _quadratic(sums: ca.SX, load: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """A, B, C of ‖T⁻¹τ‖² = A t² + 2 B t + C at its least, for load·[1, t]."""
    b = load.shape[0]
    Z, y, k = ca.vertsplit(sums, [0, b * (b + 1) // 2, sums.numel() - 1, sums.numel()])
    Z = symmetric(Z, b)
    Z += _RIDGE * ca.trace(Z) * ca.SX.eye(b)
    D, LT, order = ca.ldl(Z, False)
    fixed, slope = load[:, 0] + y, load[:, 1]
    both = ca.ldl_solve(ca.horzcat(slope, fixed), D, LT, order)
    return ca.dot(slope, both[:, 0]), ca.dot(slope, both[:, 1]), k + ca.dot(fixed, both[:, 1])


def _farthest(A: ca.SX, B: ca.SX, C: ca.SX, n_torques: int) -> ca.SX:
    """The largest t with A t² + 2 B t + C ≤ ρ².

    A box of N torques reaches, along a random direction, about as far as a ball of radius
    ρ = √(2N/π). Where no t is within it, the t that is nearest counts, less a fine.
    """
    lowest, square = C - B * B / A, 2 * n_torques / math.pi
    beyond = ca.sqrt(ca.fmax(lowest, square)) - math.sqrt(square)
    return -B / A + ca.sqrt(ca.fmax(square - lowest, 0) / A) - _BEYOND * beyond / ca.sqrt(A)
