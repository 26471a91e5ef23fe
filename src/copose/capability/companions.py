"""The ellipsoids that go with the dynamic one: velocities and forces of the closed chain.

Sources: P. Chiacchio, S. Chiaverini, L. Sciavicco, B. Siciliano, *Global task space manipulability
ellipsoids for multiple-arm systems* (1991) for those by W⁺; the others follow from what the closed
chain does. C. Melchiorri (1993) and A. Bicchi, D. Prattichizzo (2000) argue about which of them
deserve the name.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from copose.capability.ellipsoid import Ellipsoid
from copose.capability.sums import Form, column, upper_triangle
from copose.mechanics import ArmMechanics, Coupling, System
from copose.poses import Array


class ClosedChainVelocity(Form):
    """{v_o : v_oᵀW(J T⁻²Jᵀ)⁻¹Wᵀv_o ≤ 1}: velocities of the object, with T = I.

    q̇ = J⁺Wᵀv_o moves all arms together with the least ‖q̇‖. With torque scales as T its polar is the
    set of external wrenches that torques of the ball resist, internal force chosen to help:
    {h_o : h_oᵀ(W(J T⁻²Jᵀ)⁻¹Wᵀ)⁻¹h_o ≤ 1}.
    """

    uses = ("motion",)

    def arm_terms(
        self, arm: ArmMechanics, coupling: Coupling, scale: Array | ca.SX
    ) -> tuple[ca.SX, ...]:
        """The term X_iᵀ(J_iT⁻²J_iᵀ)⁻¹X_i."""
        speeds = _least_speeds(arm.J_root, coupling.motion, scale)
        return (upper_triangle(speeds.T @ speeds),)

    def gram(self, sums: Sequence[ca.SX], M_o: ca.SX) -> ca.SX:
        """G is the sum of the terms."""
        return sums[0]

    def factor(self, system: System, scales: Sequence[Array]) -> ca.SX:
        """(J T⁻¹)⁺Wᵀ, (N, m)."""
        arms = enumerate(zip(system.arms, scales, strict=True))
        return ca.vertcat(
            *(_least_speeds(arm.J_root, system.coupling(i).motion, T) for i, (arm, T) in arms)
        )


class ExternalForce(Form):
    """{h_o : h_oᵀ(W⁺ᵀJ T⁻²JᵀW⁺)h_o ≤ 1}: wrenches on the object that torques resist, shared by W⁺.

    With T = I its polar is the averaged velocity ellipsoid {v_o : v_oᵀ(W⁺ᵀJJᵀW⁺)⁻¹v_o ≤ 1}.
    """

    uses = ("share",)

    def arm_terms(
        self, arm: ArmMechanics, coupling: Coupling, scale: Array | ca.SX
    ) -> tuple[ca.SX, ...]:
        """The term (W⁺)_iᵀJ_iT⁻²J_iᵀ(W⁺)_i."""
        torques = (arm.J_root.T @ coupling.share) / column(scale)
        return (upper_triangle(torques.T @ torques),)

    def gram(self, sums: Sequence[ca.SX], M_o: ca.SX) -> ca.SX:
        """G is the sum of the terms."""
        return sums[0]

    def factor(self, system: System, scales: Sequence[Array]) -> ca.SX:
        """T⁻¹JᵀW⁺, (N, m)."""
        arms = enumerate(zip(system.arms, scales, strict=True))
        return ca.vertcat(
            *(arm.J_root.T @ system.coupling(i).share / ca.DM(T) for i, (arm, T) in arms)
        )


def _least_speeds(J: ca.SX, motion: ca.SX, scale: Array | ca.SX) -> ca.SX:
    """(J T⁻¹)⁺X, (n, m), by (J T⁻¹)ᵀ = Q R."""
    Q, R = ca.qr(J.T / column(scale))
    return Q @ ca.solve(R.T, motion)


def polar(ellipsoid: Ellipsoid) -> Ellipsoid:
    """{y : |xᵀy| ≤ 1 for all x of the centred ellipsoid}: G⁻¹ in the place of G."""
    return Ellipsoid.from_factor(ellipsoid.axes * ellipsoid.radii[:, None])


def internal_force_factor(torque_maps: Sequence[Array], balance: Sequence[Array]) -> Array:
    """T⁻¹JᵀV, V an orthonormal basis of internal wrenches: {y : ‖T⁻¹JᵀV y‖ ≤ 1}.

    Args:
        torque_maps: T_i⁻¹J_iᵀ by arm, (n_i, m).
        balance: W_i by arm, (m, m), in the same axes.

    Returns:
        (N, Km − m); without columns where a single arm has no internal force.
    """
    K, m = len(balance), balance[0].shape[1]
    V = np.linalg.svd(np.hstack(balance))[2][len(balance[0]) :].T
    rows = [T @ V[m * i : m * i + m] for i, T in enumerate(torque_maps)]
    return np.vstack(rows) if K > 1 else np.zeros((len(torque_maps[0]), 0))
