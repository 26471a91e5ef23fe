"""Sums over the arms.

With the object held still the matrices of a system are sums to which an arm adds what depends on
its own joints alone. So an arm's part is evaluated once for each of its postures.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

import casadi as ca
import numpy as np

from copose.mechanics import ArmMechanics, Coupling, System
from copose.poses import Array
from copose.problem import Space


class Sums(ABC):
    """Numbers that are sums over the arms, stacked: (s,)."""

    uses: tuple[str, ...]
    """The parts of a `Coupling` that they take."""

    @abstractmethod
    def size(self, space: Space) -> int:
        """The number of numbers."""

    @abstractmethod
    def arm_terms(
        self, arm: ArmMechanics, coupling: Coupling, scale: Array | ca.SX
    ) -> tuple[ca.SX, ...]:
        """The terms of an arm in the sums, one part after the other; of symmetric ones
        `upper_triangle`.
        """


class Form(Sums):
    """An ellipsoid {x : xᵀG x ≤ 1} whose G, (m, m), is made of sums over the arms.

    Torques, or joint speeds, are scaled by T = diag(scale): the ball is ‖T⁻¹τ‖ ≤ 1.
    """

    n_terms: ClassVar[int] = 1
    """How many symmetric matrices an arm adds."""

    def size(self, space: Space) -> int:
        """Upper triangles of n_terms matrices."""
        return self.n_terms * space.m * (space.m + 1) // 2

    @abstractmethod
    def gram(self, sums: Sequence[ca.SX], M_o: ca.SX) -> ca.SX:
        """G of the summed matrices, (m, m) each."""

    @abstractmethod
    def factor(self, system: System, scales: Sequence[Array]) -> ca.SX:
        """F with FᵀF = G, (rows, m): its singular values keep the digits that G's would lose."""

    def summed_gram(self, sums: ca.SX, M_o: ca.SX) -> ca.SX:
        """G of the stacked sums, (m, m)."""
        m = M_o.shape[0]
        parts = ca.vertsplit(sums, m * (m + 1) // 2)
        return self.gram([symmetric(part, m) for part in parts], M_o)

    def system_gram(self, system: System, scales: Sequence[Array]) -> ca.SX:
        """G of a system, (m, m)."""
        total = ca.SX(self.size(system.space), 1)
        for i, (arm, scale) in enumerate(zip(system.arms, scales, strict=True)):
            total += ca.vertcat(*self.arm_terms(arm, system.coupling(i), scale))
        return self.summed_gram(total, system.object.M_o)


def upper_triangle(matrix: ca.SX) -> ca.SX:
    """Entries of a symmetric matrix on and above the diagonal, row by row."""
    a = matrix.shape[0]
    return ca.vertcat(*(matrix[i, j] for i in range(a) for j in range(i, a)))


def symmetric(entries: ca.SX, a: int) -> ca.SX:
    """The symmetric matrix, (a, a), of its `upper_triangle`."""
    matrix, k = ca.SX(a, a), 0
    for i in range(a):
        for j in range(i, a):
            matrix[i, j] = matrix[j, i] = entries[k]
            k += 1
    return matrix


def column(scale: Array | ca.SX) -> ca.DM | ca.SX:
    """Torque scales as they divide the rows of an expression."""
    return scale if isinstance(scale, ca.SX) else ca.DM(scale)


def log_dets(matrices: Array) -> Array:
    """Log det of matrices, (a, a, count), NaN where they are not positive definite, (count,)."""
    # By the pivots of elimination: LAPACK refuses all where one is not positive definite.
    total, left = np.zeros(matrices.shape[2]), matrices
    while len(left):
        pivot = np.where(left[0, 0] > 0, left[0, 0], np.nan)
        total += np.log(pivot)
        left = left[1:, 1:] - left[1:, None, 0] * (left[None, 0, 1:] / pivot)
    return total


def traces(H: Array, G: Array) -> Array:
    """Tr(H G) of symmetric matrices, (a, a, count) and (…, a, a, count): (…, count)."""
    return np.asarray(np.einsum("ijn,...ijn->...n", H, G))


def extreme_vector(matrices: Array, which: int) -> Array:
    """Squares v vᵀ, v the eigenvector of the least eigenvalue (0) or the largest (−1)."""
    v = np.linalg.eigh(np.moveaxis(matrices, -1, 0))[1][:, :, which].T
    return np.asarray(v[:, None] * v)
