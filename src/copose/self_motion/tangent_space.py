"""The tangent space of arms' self-motions, many at once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from copose.poses import Array, Indices, Mask
from copose.self_motion.kernels import ArmKernels

_RANK = 1e-9  # ratio of a singular value to the largest that counts as zero
_DOUBT = 1e-6  # ratio of diagonal entries of R below which singular values tell the rank


@dataclass(frozen=True, eq=False)
class Tangent:
    """Tangent spaces of the closed postures of arms, with multipliers of closure and limits."""

    by_row: ClassVar[tuple[str, ...]] = ("J", "slope", "held", "basis", "forces", "left")
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
        """The tangent spaces from QR decompositions of Jᵀ without held joints; where the rank is in
        doubt, from singular value decompositions.
        """
        any_held = bool(held.any())
        moving = np.where(held[:, None], 0.0, J) if any_held else J
        basis, forces, sound = _by_reflections(moving, slope, held if any_held else None)
        if not sound.all():
            rows = ~sound
            basis[rows], forces[rows] = _by_singular_values(moving[rows], slope[rows], held[rows])
        return cls(J, slope, held, basis, forces, slope - (forces[:, None] @ J)[:, 0])

    def released(self, outward: Array) -> Tangent:
        """The same with the held joints let go that gain by leaving their limits, the most first.

        Args:
            outward: +1 at an upper limit, −1 at a lower one, (count, n).
        """
        tangent = self
        for _ in range(self.held.shape[1]):
            pull = np.where(tangent.held, -outward * tangent.left, 0.0)
            worst = pull.argmax(axis=1)
            wrong = np.flatnonzero(pull[np.arange(len(pull)), worst] > 1e-9)
            if len(wrong) == 0:
                break
            held = tangent.held.copy()
            held[wrong, worst[wrong]] = False
            tangent = tangent._with(held, wrong)
        return tangent

    def holding(self, more: Mask) -> Tangent:
        """The same with more joints held, (count, n)."""
        return self._with(self.held | more, np.flatnonzero(more.any(axis=1)))

    def taken(self, rows: Mask | Indices) -> Self:
        """The tangent spaces of some arms."""
        return replace(self, **{name: getattr(self, name)[rows] for name in self.by_row})

    def _with(self, held: Mask, rows: Indices) -> Tangent:
        """The same with other joints held in some rows."""
        if len(rows) == len(held):
            return self._again(held)
        return self._put(rows, self.taken(rows)._again(held[rows]))

    def _put(self, rows: Indices, others: Tangent) -> Self:
        """The same with others in some rows."""
        parts = {name: getattr(self, name).copy() for name in self.by_row}
        for name, values in parts.items():
            values[rows] = getattr(others, name)
        return replace(self, **parts)

    def _again(self, held: Mask) -> Tangent:
        """The tangent spaces with other joints held."""
        return Tangent.of(self.J, self.slope, held)


@dataclass(frozen=True, eq=False)
class ChainTangent(Tangent):
    """Tangent spaces of arms whose weighted terms are the objective, and what a Newton step takes
    along them.
    """

    by_row: ClassVar[tuple[str, ...]] = (*Tangent.by_row, "change", "bend", "x", "given")
    change: Array  # derivatives of the arm's terms along the basis, (count, n − m, s)
    # Second derivatives along it of weightsᵀ terms − forcesᵀ closure, (count, n − m, n − m).
    bend: Array
    kernels: ArmKernels
    x: Array  # joints and weights of the terms, (count, n + s)
    given: Array  # goals and ties, (count, …)

    @classmethod
    def at(cls, kernels: ArmKernels, x: Array, given: Array, held: Mask) -> ChainTangent:
        """The tangent spaces at joints and weights, (count, n + s): with one degree of freedom to
        spare by one kernel but where the rank is in doubt, else by differences.
        """
        if kernels.line is None:
            return cls._by_differences(kernels, x, given, held)
        m, n, s = kernels.m, kernels.n, x.shape[1] - kernels.n
        values, first = kernels.line(np.hstack([x, held]), given), 0
        parts = list[Array]()
        # A tenth of the time that np.split takes.
        for size in (n, m, n, n, s, 1, 1, m * n):
            parts.append(values[:, first : first + size])
            first += size
        basis, forces, left, slope, change, bend, sound, J = parts
        one = cls(
            J.reshape(-1, m, n), slope, held, basis[:, None], forces, left, change[:, None],
            bend[:, None], kernels, x, given,
        )  # fmt: skip
        doubtful = np.flatnonzero(~(sound[:, 0] > _DOUBT))
        if not len(doubtful):
            return one
        some = x[doubtful], given[doubtful], held[doubtful]
        return one._put(doubtful, cls._by_differences(kernels, *some))

    @classmethod
    def _by_differences(
        cls, kernels: ArmKernels, x: Array, given: Array, held: Mask
    ) -> ChainTangent:
        m, n, s, h = kernels.m, kernels.n, x.shape[1] - kernels.n, 1e-6  # rad or m
        terms, J, slope = np.split(kernels.local(x, given), [s, s + m * n], axis=1)
        tangent = Tangent.of(J.reshape(-1, m, n), slope, held)
        count, d, _ = tangent.basis.shape
        beside = np.repeat(x[:, None], d, axis=1)
        beside[..., :n] += h * tangent.basis
        values = kernels.local(beside.reshape(count * d, n + s), np.repeat(given, d, axis=0))
        values = values.reshape(count, d, s + m * n + n) - np.hstack([terms, J, slope])[:, None]
        change, turn, bend = np.split(values, [s, s + m * n], axis=2)
        bend -= (tangent.forces[:, None, None] @ turn.reshape(count, d, m, n))[:, :, 0]
        return cls(
            tangent.J, slope, held, tangent.basis, tangent.forces, tangent.left, change / h,
            bend @ tangent.basis.transpose(0, 2, 1) / h, kernels, x, given,
        )  # fmt: skip

    def _again(self, held: Mask) -> ChainTangent:
        return self.at(self.kernels, self.x, self.given, held)


def _by_reflections(J: Array, slope: Array, held: Mask | None) -> tuple[Array, Array, Mask]:
    """Bases and multipliers by QR decompositions, and where they can be trusted.

    Held joints join Jᵀ as unit columns, so that what is orthogonal to all columns moves none.
    """
    count, m, n = J.shape
    if n < m:
        nothing = np.zeros((count, 0, n)), np.zeros((count, m))
        return *nothing, np.zeros(count, dtype=bool)
    columns = J.swapaxes(1, 2)
    if held is not None:
        stopped = held.sum(axis=1)
        order = np.argsort(~held, axis=1, kind="stable")[:, : stopped.max()]
        units = np.zeros((count, n, order.shape[1]))
        np.put_along_axis(units, order[:, None], 1.0, axis=1)
        units *= np.arange(order.shape[1]) < stopped[:, None, None]
        columns = np.concatenate([columns, units], axis=2)
    Q, R = np.linalg.qr(columns, mode="complete")
    R = R[:, :m, :m]
    size = np.abs(np.diagonal(R, axis1=1, axis2=2))
    sound = size.min(axis=1) > _DOUBT * size.max(axis=1)
    R[~sound] = np.eye(m)
    along = (slope[:, None] @ Q[:, :, :m]).swapaxes(1, 2)
    basis = Q[:, :, m:].swapaxes(1, 2).copy()
    if held is not None:
        basis[np.arange(n - m) < stopped[:, None]] = 0.0
        # To the last bit: a held joint has no room to move by a rounding error.
        basis *= ~held[:, None]
    return basis, np.linalg.solve(R, along)[:, :, 0], np.asarray(sound)


def _by_singular_values(J: Array, slope: Array, held: Mask) -> tuple[Array, Array]:
    """Bases and multipliers of least norm by singular value decompositions, of any rank."""
    U, s, V = np.linalg.svd(J)
    k = s.shape[1]
    inverse = np.zeros_like(s)
    np.divide(1.0, s, out=inverse, where=s > _RANK * s[:, :1])
    along = (V[:, :k] @ slope[:, :, None])[:, :, 0] * inverse
    forces = (along[:, None] @ U[:, :, :k].swapaxes(1, 2))[:, 0]
    return _free_part(V[:, k:], held), forces


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
