"""Which torques an acceleration of the object takes, as CasADi expressions.

Source: P. Chiacchio, S. Chiaverini, B. Siciliano, *Dynamic Manipulability Ellipsoid for
Cooperating Robots*.
"""

from __future__ import annotations

import casadi as ca

from copose.mechanics import ArmMechanics, System


def own_torque_map(arm: ArmMechanics) -> ca.SX:
    """M J⁺: torques τ = M J⁺ a that accelerate the arm's own tip by a, (n, m).

    J⁺ = Q R⁻ᵀ from Jᵀ = Q R: through J Jᵀ half of the digits would be lost.
    """
    Q, R = ca.qr(arm.J.T)
    return ca.solve(R, (arm.M @ Q).T).T


def torque_maps(system: System) -> tuple[ca.SX, ...]:
    """Blocks of A_o = M J⁺Wᵀ + JᵀW⁺M_o, one per arm, (n_i, m): τ_i = A_i a_o."""
    held = system.object
    return tuple(
        own_torque_map(arm) @ W_i.T + arm.J.T @ (W_pinv_i @ held.M_o)
        for arm, W_i, W_pinv_i in zip(system.arms, held.W, held.W_pinv, strict=True)
    )


def gram(torque_map: ca.SX) -> ca.SX:
    """AᵀA; A_o stacks one block per arm, so its Gram matrix is the sum of theirs, (m, m)."""
    return torque_map.T @ torque_map


def log_det(matrix: ca.SX) -> ca.SX:
    """Log det of a symmetric positive definite matrix, by LDLᵀ."""
    D, _, _ = ca.ldl(matrix, False)
    return ca.sum1(ca.log(D))
