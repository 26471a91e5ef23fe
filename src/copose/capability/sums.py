"""Sums over the arms.

With the object held still the matrices of a system are sums to which an arm adds what depends on
its own joints alone. So an arm's part is evaluated once for each of its postures.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
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


# The same entries of many matrices as numbers, (s, count).


def _places(entries: Array) -> Iterator[tuple[int, int]]:
    a = dimension(entries)
    return ((i, j) for i in range(a) for j in range(i, a))


def dimension(entries: Array) -> int:
    """The dimension of matrices by the number of entries of their upper triangles."""
    return int(np.sqrt(2 * len(entries)))


def log_dets(entries: Array) -> Array:
    """Log det of matrices, NaN where they are not positive definite, (count,)."""
    a, at = dimension(entries), dict(zip(_places(entries), entries.copy(), strict=True))
    total = np.zeros(entries.shape[1])
    for k in range(a):
        pivot = np.where(at[k, k] > 0, at[k, k], np.nan)
        total += np.log(pivot)
        for i in range(k + 1, a):
            scaled = at[k, i] / pivot
            for j in range(i, a):
                at[i, j] -= scaled * at[k, j]
    return total


def traces(H: Array, G: Array) -> Array:
    """Tr(H G) of symmetric matrices, (s, count) and (…, s, count): (…, count)."""
    twice = np.array([1.0 if i == j else 2.0 for i, j in _places(H)])
    return np.asarray(np.einsum("s,sn,...sn->...n", twice, H, G))


def squares(vectors: Array) -> Array:
    """Entries of v vᵀ, of vectors (a, count)."""
    rows, columns = np.triu_indices(len(vectors))
    return np.asarray(vectors[rows] * vectors[columns])


def matrices(entries: Array) -> Array:
    """The symmetric matrices, (count, a, a)."""
    rows, columns = np.triu_indices(dimension(entries))
    whole = np.empty((entries.shape[1], rows[-1] + 1, rows[-1] + 1))
    whole[:, rows, columns] = whole[:, columns, rows] = entries.T
    return whole


def extreme_vector(entries: Array, which: int) -> Array:
    """Entries of v vᵀ, v the eigenvector of the least eigenvalue (0) or the largest (−1)."""
    return squares(np.linalg.eigh(matrices(entries))[1][:, :, which].T)
