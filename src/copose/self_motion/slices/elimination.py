"""Elimination: the angles of a closed loop of six revolute joints, every solution.

Source: M. Raghavan, B. Roth, *Inverse kinematics of the general 6R manipulator* (1993). The loop is
D₁R(θ₁) D₂R(θ₂) … D₆R(θ₆) = I, R about z. Fourteen equations in p and l, the last two columns of
R(θ₃)D₄R(θ₄)D₅R(θ₅)D₆ = D₃⁻¹R(−θ₂)D₂⁻¹R(−θ₁)D₁⁻¹, are linear in 1, cos and sin of each angle. Their
coefficients are those of a Fourier transform over three values of each angle, so that the frames
may be any. Eight combinations take θ₁ and θ₂ away; six equations and their multiples by
tan(θ₄/2) are a quadratic pencil in tan(θ₃/2), (12, 12), with 24 eigenvalues.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array, Mask


@dataclass(frozen=True)
class EliminationOptions:
    """Numbers of an elimination."""

    # Angles by which the joints' zeros are turned, so that no angle of note is at infinity, rad.
    offsets: tuple[float, ...] = (0.3, -0.7, 0.9, 0.5, -1.1)
    imaginary: float = 0.15  # part of an eigenvalue λ that counts as real, over 1 + Re(λ)²
    rank: float = 1e-9  # singular values, over the largest, of which none is inverted


def turns(angles: Array) -> Array:
    """Rotations about z as homogeneous matrices, (..., 4, 4)."""
    T = np.zeros((*np.shape(angles), 4, 4))
    T[..., 0, 0] = T[..., 1, 1] = np.cos(angles)
    T[..., 1, 0] = np.sin(angles)
    T[..., 0, 1] = -T[..., 1, 0]
    T[..., 2, 2] = T[..., 3, 3] = 1.0
    return T


def loop_angles(
    D: Array, cut: int, options: EliminationOptions = EliminationOptions()
) -> tuple[Array, Mask]:
    """Angles that may close loops, (count, 24, 6), and which are worth a closer look.

    Args:
        D: the motions before the six joints, (count, 6, 4, 4).
        cut: the joint that comes first in the elimination, 0 … 5.
        options: offsets and tolerances.
    """
    D, phi, count = np.roll(D, -cut, axis=1), np.array(options.offsets), len(D)
    left, right = _equations(D, phi)
    x, ok, vectors = _eigenvalues(left, right, options)
    # Quotients of monomials that differ by one power, the largest of all among them.
    i, j = np.divmod(np.abs(vectors).reshape(count, 12, 24).argmax(axis=1), 3)
    b, k = np.indices(x.shape)
    with np.errstate(all="ignore"):
        quotients = [
            vectors[b, i, j, k] / vectors[b, i + np.where(i > 0, -1, 1), j, k],
            vectors[b, i, j, k] / vectors[b, i, j + np.where(j > 0, -1, 1), k],
        ]
        x4, x5 = (np.where(at > 0, y, 1 / y).real
                  for at, y in zip((i, j), quotients, strict=True))  # fmt: skip
    angles = 2 * np.arctan(np.stack([x, x4, x5], axis=-1))
    powers = np.stack([np.ones_like(angles), np.cos(angles), np.sin(angles)], axis=-1)
    m3, m4, m5 = np.moveaxis(powers, 2, 0)
    values = np.einsum("nmabc,nea,neb,nec->nem", left, m3, m4, m5, optimize=True)
    inverse = np.linalg.pinv(right[:, :, 1:], rcond=options.rank)
    ahead = values @ inverse.swapaxes(1, 2)
    # Of 1, cos, sin of θ₁ times those of θ₂ the first is on the left.
    th1, th2 = np.arctan2(ahead[..., 5], ahead[..., 2]), np.arctan2(ahead[..., 1], ahead[..., 0])
    five = np.nan_to_num(np.concatenate([np.stack([th1, th2], axis=-1), angles], axis=-1) + phi)
    T = np.broadcast_to(np.eye(4), (*x.shape, 4, 4))
    for joint in range(5):
        T = T @ D[:, joint, None] @ turns(five[..., joint])
    T = T @ D[:, 5, None]
    sixth = np.arctan2(T[..., 0, 1] - T[..., 1, 0], T[..., 0, 0] + T[..., 1, 1])
    return np.asarray(np.roll(np.dstack([five, sixth]), cut, axis=-1)), ok


def _equations(D: Array, phi: Array) -> tuple[Array, Array]:
    """Coefficients of the fourteen equations left = right: (count, 14, 3, 3, 3) of 1, cos, sin of
    θ₃, θ₄, θ₅, the constant of the right among them, and (count, 14, 9) of θ₁ and θ₂.
    """
    third = 2 * np.pi * np.arange(3) / 3
    fit = np.linalg.inv(np.stack([np.ones(3), np.cos(third), np.sin(third)], axis=1))
    R = turns(third + phi[:, None])
    D1, D2, D3, D4, D5, D6 = np.moveaxis(D, 1, 0)
    inner = R[3][:, None] @ (D5[:, None] @ (R[4] @ D6[:, None]))[:, None]
    whole = R[2][:, None, None] @ (D4[:, None, None] @ inner)[:, None]
    left = np.einsum("ai,bj,ck,nijkm->nmabc", fit, fit, fit, _fourteen(whole))
    inverse = np.linalg.inv
    back = inverse(D2)[:, None] @ (inverse(R[0]) @ inverse(D1)[:, None])
    back = inverse(R[1]) @ back[:, :, None]
    right = _fourteen(inverse(D3)[:, None, None] @ back)
    right = np.einsum("ai,bj,nijm->nmab", fit, fit, right).reshape(len(D), 14, 9)
    left[:, :, 0, 0, 0] -= right[:, :, 0]
    return left, right


def _fourteen(T: Array) -> Array:
    """p, l, p·p, p·l, p × l and (p·p) l − 2 (p·l) p of motions, (..., 14)."""
    p, z = T[..., :3, 3], T[..., :3, 2]
    pp, pz = (p * p).sum(axis=-1, keepdims=True), (p * z).sum(axis=-1, keepdims=True)
    return np.concatenate([p, z, pp, pz, np.cross(p, z), pp * z - 2 * pz * p], axis=-1)


def _eigenvalues(
    left: Array, right: Array, options: EliminationOptions
) -> tuple[Array, Mask, Array]:
    """tan(θ₃/2), (count, 24), which of them are nearly real, and powers of tan(θ₄/2) and tan(θ₅/2)
    there, up to a factor, (count, 4, 3, 24).
    """
    count = len(left)
    null = np.linalg.svd(right[:, :, 1:])[0][:, :, 8:]
    # From 1, cos, sin to powers of the half angle's tangent, times 1 + its square.
    half = np.array([[1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [0.0, 2.0, 0.0]])
    six = np.einsum("nmr,nmabc,ax,by,cz->nxryz", null, left, half, half, half, optimize=True)
    twelve = np.zeros((count, 3, 12, 4, 3))
    twelve[:, :, :6, :3] = twelve[:, :, 6:, 1:] = six
    pencil = twelve.reshape(count, 3, 12, 12)
    scale = np.abs(pencil).max(axis=(1, 3), keepdims=True)
    A0, A1, A2 = np.moveaxis(pencil / np.where(scale > 0, scale, 1.0), 1, 0)
    companion = np.zeros((count, 24, 24))
    companion[:, :12, 12:] = np.eye(12)
    singular = np.linalg.cond(A2) > 1e15
    A2[singular] = np.eye(12)
    companion[:, 12:] = -np.linalg.solve(A2, np.concatenate([A0, A1], axis=2))
    values, vectors = np.linalg.eig(companion)
    ok = np.abs(values.imag) < options.imaginary * (1 + values.real**2)
    return values.real, ok & ~singular[:, None], vectors[:, :12].reshape(count, 4, 3, 24)
