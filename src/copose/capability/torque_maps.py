"""Ellipsoids of the accelerations that the unit torque ball gives the object, as expressions.

Both ellipsoids belong to τ = M q̈ + Jᵀh, J q̈ = Wᵀa_o, W h = M_o a_o. They differ in who chooses
the null motion and the internal force: a least-norm rule, or the forward dynamics. Both are made of
terms that add up over the arms, and an arm's terms depend on its own joints alone.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar

import casadi as ca

from copose.capability.sums import Form, column, upper_triangle
from copose.mechanics import ArmMechanics, Coupling, System
from copose.poses import Array


class Resolution(Form):
    """The ellipsoid of accelerations of one way to resolve null motion and internal force."""

    name: ClassVar[str]
    assumes: ClassVar[str]

    @abstractmethod
    def own_factor(self, arm: ArmMechanics, scale: Array) -> ca.SX:
        """A factor of G of one arm alone at its tip, (rows, m)."""


class Pseudoinverse(Resolution):
    """The paper's: G = A_oᵀT⁻²A_o with A_o = M J⁺Wᵀ + JᵀW⁺M_o.

    Source: P. Chiacchio, S. Chiaverini, B. Siciliano, *Dynamic Manipulability Ellipsoid for
    Cooperating Robots*.
    """

    name = "pseudoinverse"
    assumes = "least-norm q̈ and h"
    uses = ("motion", "load")

    def arm_terms(
        self, arm: ArmMechanics, coupling: Coupling, scale: Array | ca.SX
    ) -> tuple[ca.SX, ...]:
        """The term (T⁻¹A_i)ᵀ(T⁻¹A_i)."""
        block = _coupled_torque_map(arm, coupling) / column(scale)
        return (upper_triangle(block.T @ block),)

    def gram(self, sums: Sequence[ca.SX], M_o: ca.SX) -> ca.SX:
        """A_o stacks one block per arm, so its Gram matrix is the sum of theirs."""
        return sums[0]

    def factor(self, system: System, scales: Sequence[Array]) -> ca.SX:
        """T⁻¹A_o, (N, m)."""
        return ca.vertcat(*(torque_map(system, i) / ca.DM(scale) for i, scale in enumerate(scales)))

    def own_factor(self, arm: ArmMechanics, scale: Array) -> ca.SX:
        """T⁻¹M J⁺, (n, m)."""
        return own_torque_map(arm) / ca.DM(scale)


class TorqueOptimal(Resolution):
    """Every torque of the ball is used: G = (B T²Bᵀ)⁻¹ = S R⁻¹S, a_o = B τ the forward dynamics.

    S = M_o + Σ W_iΛ_iW_iᵀ, R = Σ W_iΛ_iJ_iM_i⁻¹T_i²M_i⁻¹J_iᵀΛ_iW_iᵀ, Λ_i = (J_iM_i⁻¹J_iᵀ)⁻¹.
    """

    name = "torque-optimal"
    assumes = "q̈ and h of least torque"
    n_terms = 2
    uses = ("motion",)

    def arm_terms(
        self, arm: ArmMechanics, coupling: Coupling, scale: Array | ca.SX
    ) -> tuple[ca.SX, ...]:
        """W_iΛ_iW_iᵀ and the arm's summand of R."""
        V, P = inertia_factors(arm, coupling)
        Y = V @ (P * column(scale)).T
        return upper_triangle(V @ V.T), upper_triangle(Y @ Y.T)

    def gram(self, sums: Sequence[ca.SX], M_o: ca.SX) -> ca.SX:
        """The matrix S R⁻¹S."""
        S = sums[0] + M_o
        D, LT, order = ca.ldl(sums[1], False)
        return S @ ca.ldl_solve(S, D, LT, order)

    def factor(self, system: System, scales: Sequence[Array]) -> ca.SX:
        """U⁻ᵀS, (m, m), where UᵀU = R comes from the QR factors of R's square root."""
        S, rows = system.object.M_o, []
        for i, scale in enumerate(scales):
            V, P = inertia_factors(system.arms[i], system.coupling(i))
            S = S + V @ V.T
            rows.append((P * ca.DM(scale)) @ V.T)
        _, U = ca.qr(ca.vertcat(*rows))
        return ca.solve(U.T, S)

    def own_factor(self, arm: ArmMechanics, scale: Array) -> ca.SX:
        """U⁻ᵀ with UᵀU = J M⁻¹T²M⁻¹Jᵀ (T. Yoshikawa, 1985), (m, m)."""
        R_M = ca.chol(arm.M)
        columns = ca.solve(R_M, ca.solve(R_M.T, arm.J.T)) * ca.DM(scale)
        _, U = ca.qr(columns)
        return ca.solve(U.T, ca.SX.eye(arm.J.shape[0]))


RESOLUTIONS: dict[str, Resolution] = {
    resolution.name: resolution for resolution in (Pseudoinverse(), TorqueOptimal())
}


def own_torque_map(arm: ArmMechanics) -> ca.SX:
    """M J⁺: torques τ = M J⁺ a that accelerate the arm's own tip by a, world axes, (n, m)."""
    return inertia_times_pinv(arm.M, arm.J)


def torque_map(system: System, i: int) -> ca.SX:
    """Arm i's block of A_o, M J⁺W_iᵀ + Jᵀ(W⁺)_iM_o, (n_i, m): τ_i = A_i a_o."""
    return _coupled_torque_map(system.arms[i], system.coupling(i))


def _coupled_torque_map(arm: ArmMechanics, coupling: Coupling) -> ca.SX:
    through_motion = inertia_times_pinv(arm.M, arm.J_root) @ coupling.motion
    return through_motion + arm.J_root.T @ coupling.load


def inertia_times_pinv(M: ca.SX, J: ca.SX) -> ca.SX:
    """M J⁺ with J⁺ = Q R⁻ᵀ from Jᵀ = Q R: through J Jᵀ half of the digits would be lost."""
    Q, R = ca.qr(J.T)
    return ca.solve(R, (M @ Q).T).T


def inertia_factors(arm: ArmMechanics, coupling: Coupling) -> tuple[ca.SX, ca.SX]:
    """V, (m, m), and P, (n, m), with W_iΛ_iW_iᵀ = V Vᵀ and W_iΛ_iJ_iM_i⁻¹ = V Pᵀ: V = W U⁻¹."""
    P, U = tip_inertia(arm)
    return ca.solve(U.T, coupling.motion).T, P


def tip_inertia(arm: ArmMechanics) -> tuple[ca.SX, ca.SX]:
    """P, (n, m), and U, (m, m), with Λ_i = U⁻¹U⁻ᵀ and J_iM_i⁻¹ = UᵀPᵀ.

    From M = LLᵀ and L⁻¹Jᵀ = Q U: P = L⁻ᵀQ.
    """
    R_M = ca.chol(arm.M)
    Q, U = ca.qr(ca.solve(R_M.T, arm.J_root.T))
    return ca.solve(R_M, Q), U


def forward_dynamics(system: System, gravity: ca.SX, velocity: ca.SX) -> tuple[ca.SX, ca.SX]:
    """B, (m, N), and c, (m,): the object's acceleration is a_o = B τ + c.

    B = S⁻¹[… W_iΛ_iJ_iM_i⁻¹ …]; the acceleration at zero torque, the centre of the ellipsoid, is
    c = −B(c_q + g) + S⁻¹(W Λ(J̇q̇ − Ẇᵀv_o) − c_o − g_o), joint speeds least-norm: q̇ = J⁺Wᵀv_o.

    Args:
        system: arms and object.
        gravity: acceleration of free fall in world axes, m/s², (3,).
        velocity: of the object, v_o, (m,).
    """
    held, space = system.object, system.space
    rows = list(space.rows)
    full = ca.SX(6, 1)
    full[rows] = velocity
    omega = full[3:]
    weight = ca.vertcat(gravity * held.mass, ca.SX(3, 1))[rows]
    gyroscopic = ca.vertcat(ca.SX(3, 1), ca.cross(omega, held.inertia @ omega))[rows]
    S, force, pushes = held.M_o, weight - gyroscopic, []
    for i, arm in enumerate(system.arms):
        V, P = inertia_factors(arm, system.coupling(i))
        Q, R = ca.qr(arm.J.T)
        speed = Q @ ca.solve(R.T, held.W[i].T @ velocity)
        swing = ca.cross(omega, ca.cross(omega, held.contacts[i]))
        turning = ca.vertcat(swing, ca.SX(3, 1))[rows]
        lag = arm.velocity_acceleration(speed) - turning
        torque = arm.velocity_torques(speed) + arm.gravity_torques(gravity)
        S = S + V @ V.T
        # Λ x = U⁻¹U⁻ᵀx = W⁻¹V (W⁻¹V)ᵀx, and W Λ x = V (W⁻¹V)ᵀx.
        force = force - V @ (P.T @ torque) + V @ (ca.solve(held.W[i], V).T @ lag)
        pushes.append(V @ P.T)
    D, LT, order = ca.ldl(S, False)
    both = ca.ldl_solve(ca.horzcat(*pushes, force), D, LT, order)
    return both[:, :-1], both[:, -1]


def log_det(matrix: ca.SX) -> ca.SX:
    """Log det of a symmetric positive definite matrix, by LDLᵀ."""
    D, _, _ = ca.ldl(matrix, False)
    return ca.sum1(ca.log(D))
