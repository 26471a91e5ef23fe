"""The tangent space of arms' self-motions, many at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array, Mask


@dataclass(frozen=True, eq=False)
class Tangent:
    """Tangent spaces of the closed postures of arms, with multipliers of closure and limits."""

    J: Array  # derivative of the closure, (count, m, n)
    slope: Array  # gradient of the objective, (count, n)
    held: Mask  # joints held at a limit, (count, n)
    basis: Array  # orthonormal rows, zero where limits leave fewer, (count, n − m, n)
    forces: Array  # multipliers of the closure, (count, m)
    # Slope − Jᵀ forces, (count, n): the multipliers of held joints, and of the others the slope
    # that is left along the tangent space.
    left: Array

    @classmethod
    def of(cls, J: Array, slope: Array, held: Mask) -> Tangent:
        """The tangent spaces from singular value decompositions of J without held joints."""
        rank = 1e-9  # ratio of a singular value to the largest that counts as zero
        any_held = held.any()
        U, s, V = np.linalg.svd(np.where(held[:, None], 0.0, J) if any_held else J)
        k = s.shape[1]
        inverse = np.zeros_like(s)
        np.divide(1.0, s, out=inverse, where=s > rank * s[:, :1])
        along = (V[:, :k] @ slope[:, :, None])[:, :, 0] * inverse
        forces = (along[:, None] @ U[:, :, :k].swapaxes(1, 2))[:, 0]
        left = slope - (forces[:, None] @ J)[:, 0]
        basis = _free_part(V[:, k:], held) if any_held else V[:, k:]
        return cls(J, slope, held, basis, forces, left)

    def released(self, outward: Array) -> Tangent:
        """The same with the held joints let go that gain by leaving their limits, the most first.

        Args:
            outward: +1 at an upper limit, −1 at a lower one, (count, n).
        """
        tangent = self
        for _ in range(self.held.shape[1]):
            if not tangent.held.any():
                break
            pull = np.where(tangent.held, -outward * tangent.left, 0.0)
            worst = pull.argmax(axis=1)
            wrong = np.flatnonzero(pull[np.arange(len(pull)), worst] > 1e-9)
            if len(wrong) == 0:
                break
            held = tangent.held.copy()
            held[wrong, worst[wrong]] = False
            tangent = Tangent.of(self.J, self.slope, held)
        return tangent

    def holding(self, more: Mask) -> Tangent:
        """The same with more joints held, (count, n)."""
        return Tangent.of(self.J, self.slope, self.held | more) if more.any() else self

    def taken(self, rows: Mask) -> Tangent:
        """The tangent spaces of some arms."""
        return Tangent(
            self.J[rows], self.slope[rows], self.held[rows], self.basis[rows], self.forces[rows],
            self.left[rows],
        )  # fmt: skip


def _free_part(null: Array, held: Mask) -> Array:
    """The part of a null space that moves no held joint, orthonormal rows, (count, d, n).

    Args:
        null: orthonormal rows, (count, d, n), that span it together with the held directions.
        held: (count, n).
    """
    if null.shape[1] == 0:
        return null
    _, sizes, rows = np.linalg.svd(np.where(held[:, None], 0.0, null), full_matrices=False)
    # To the last bit: a held joint has no room to move by a rounding error.
    return np.where((sizes > 0.5)[:, :, None] & ~held[:, None], rows, 0.0)
