"""The tangent space of arms' self-motions, many at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array, Mask

_RANK = 1e-9


@dataclass(frozen=True, eq=False)
class Tangent:
    """Where arms can move while they hold the object, and what keeps them from moving elsewhere.

    Attributes:
        J: derivative of the closure, (count, m, n).
        slope: of what is maximised, (count, n).
        held: joints that a limit stops, (count, n).
        basis: orthonormal rows, zero where limits leave fewer, (count, n − m, n).
        forces: multipliers of the closure, (count, m).
        left: what they leave of the slope, (count, n): the multipliers of held joints, and at the
            others what is still to gain.
    """

    J: Array
    slope: Array
    held: Mask
    basis: Array
    forces: Array
    left: Array

    @classmethod
    def of(cls, J: Array, slope: Array, held: Mask) -> Tangent:
        """From the singular values of J with the columns of held joints taken out."""
        any_held = held.any()
        U, s, V = np.linalg.svd(np.where(held[:, None], 0.0, J) if any_held else J)
        k = s.shape[1]
        inverse = np.zeros_like(s)
        np.divide(1.0, s, out=inverse, where=s > _RANK * s[:, :1])
        along = (V[:, :k] @ slope[:, :, None])[:, :, 0] * inverse
        forces = (along[:, None] @ U[:, :, :k].swapaxes(1, 2))[:, 0]
        left = slope - (forces[:, None] @ J)[:, 0]
        basis = _free_part(V[:, k:], held) if any_held else V[:, k:]
        return cls(J, slope, held, basis, forces, left)

    def released(self, outward: Array) -> Tangent:
        """With held joints that gain by leaving their limits let go, whichever gains most first.

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
        """With more joints held, (count, n)."""
        return Tangent.of(self.J, self.slope, self.held | more) if more.any() else self

    def taken(self, rows: Mask) -> Tangent:
        """Those of some arms."""
        return Tangent(
            self.J[rows], self.slope[rows], self.held[rows], self.basis[rows], self.forces[rows],
            self.left[rows],
        )  # fmt: skip


def _free_part(null: Array, held: Mask) -> Array:
    """Of the null space of a matrix with held columns taken out, the part that moves no held joint.

    Args:
        null: orthonormal rows, (count, d, n), that span it together with the held directions.
        held: (count, n).
    """
    if null.shape[1] == 0:
        return null
    _, sizes, rows = np.linalg.svd(np.where(held[:, None], 0.0, null), full_matrices=False)
    # To the last bit: a held joint has no room to move by a rounding error.
    return np.where((sizes > 0.5)[:, :, None] & ~held[:, None], rows, 0.0)
