"""Cost, constraints and sparse derivatives of a motion's program, evaluated by numpy.

All that is nonlinear is a knot's own; knots meet in linear rows and in the joints' smoothness.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from copose.motion.nlp.clearance_rows import ClearanceRows
from copose.motion.nlp.knot import KnotNlp
from copose.motion.nlp.linear_rows import LinearRows
from copose.poses import Array, Indices, Mask


class MotionFunctions:
    """Functions of a motion's program at x, the variables y of all knots one after the other.

    Rows are the knots' constraints that count, the linear rows and those on clearance, in order.

    Attributes:
        height: number of rows.
        jacobian_pattern: of the rows by x.
        hessian_pattern: of the Lagrangian, upper triangle.
    """

    def __init__(
        self,
        task: KnotNlp,
        parameters: Array,
        counted: Mask,
        linear: LinearRows,
        clearance: ClearanceRows | None,
        smoothing: float,
        difference: float = 1e-7,
    ) -> None:
        """Lay out the patterns of the whole program's derivatives from those of a knot's.

        Args:
            task: the program at a knot.
            parameters: of every knot, see `KnotNlp`, (n, p).
            counted: which constraints of every knot have bounds, (n, g).
            linear: rows that tie the knots.
            clearance: rows that keep bodies apart.
            smoothing: cost of the sum of squared steps of the joints.
            difference: step of the Hessian's finite differences, rad or m.
        """
        self._task, self._parameters, self._linear = task, parameters, linear
        self._clearance, self._smoothing, self._difference = clearance, smoothing, difference
        self._count, self._size, self._joints = len(parameters), task.size, task.joints
        self._counted = np.flatnonzero(counted)
        # −level is minimised.
        self._sign = -1.0 if task.shared == "level" else 1.0
        # The solver asks for cost and rows one by one.
        self._known: tuple[Array, list[Array | float]] | None = None
        self._starts = np.arange(self._count)[:, None]
        self._spaced = 0 if clearance is None else len(clearance)
        self.height = len(self._counted) + len(linear.lower) + self._spaced
        self.jacobian_pattern, self._jacobian_order = self._laid_out_jacobian()
        self.hessian_pattern, self._hessian_order = self._laid_out_hessian()

    def _laid_out_jacobian(self) -> tuple[ca.Sparsity, Indices]:
        task, starts, linear = self._task, self._starts, self._linear
        below, own = len(self._counted), len(task.bounds[0])
        places = np.full(own * self._count, -1)
        places[self._counted] = np.arange(below)
        places = places[(task.pattern[0] + own * starts).ravel()]
        self._entries = np.flatnonzero(places >= 0)
        rows = [places[self._entries], linear.rows + below]
        columns = [(task.pattern[1] + self._size * starts).ravel()[self._entries], linear.columns]
        if self._clearance is not None:
            row, column = np.nonzero(self._clearance.moved)
            rows.append(row + below + len(linear.lower))
            columns.append(column + self._size * self._clearance.knots[row])
        return _compressed(
            self.height, self._size * self._count, np.concatenate(rows), np.concatenate(columns)
        )

    def _laid_out_hessian(self) -> tuple[ca.Sparsity, Indices]:
        task, size, N = self._task, self._size, self._joints
        mask = np.zeros((size, size), dtype=bool)
        if self._clearance is not None:
            mask[self._clearance.coupled] = True
        mask[task.coupled] = mask[task.curved] = True
        mask[np.arange(N), np.arange(N)] = True
        self._local = i, j = np.nonzero(mask)
        diagonal = (size * self._starts[:-1] + np.arange(N)).ravel()
        rows = np.concatenate([(i + size * self._starts).ravel(), diagonal])
        columns = np.concatenate([(j + size * self._starts).ravel(), diagonal + size])
        return _compressed(size * self._count, size * self._count, rows, columns)

    def values(self, x: Array, p: Array) -> list[Array | float]:
        """The cost and the rows."""
        if self._known is None or not np.array_equal(self._known[0], x):
            self._known = x, self._computed(x)
        return self._known[1]

    def _computed(self, x: Array) -> list[Array | float]:
        y = x.reshape(self._count, self._size)
        values = self._task.value(y, self._parameters)
        q = y[:, : self._joints]
        cost = self._smoothing * float((np.diff(q, axis=0) ** 2).sum())
        if self._task.shared is None:
            cost -= float(values[:, 0].mean())
        else:
            cost += self._sign * float(y[0, self._task.slices[self._task.shared].start])
        rows = [values[:, 1:].ravel()[self._counted], self._linear.values(x)]
        if self._clearance is not None:
            rows.append(self._clearance.values(q))
        return [cost, np.concatenate(rows)]

    def gradient(self, x: Array, p: Array) -> list[Array | float]:
        """The cost and its gradient."""
        y = x.reshape(self._count, self._size)
        slopes = self._task.slopes(y, self._parameters)[:, : self._size]
        gradient = np.zeros_like(y)
        if self._task.shared is None:
            gradient = -slopes / self._count
        else:
            gradient[0, self._task.slices[self._task.shared]] = self._sign
        moved = 2 * self._smoothing * np.diff(y[:, : self._joints], axis=0)
        gradient[1:, : self._joints] += moved
        gradient[:-1, : self._joints] -= moved
        return [self.values(x, p)[0], gradient.ravel()]

    def jacobian(self, x: Array, p: Array) -> list[Array | float]:
        """The rows and the entries of their Jacobian."""
        y = x.reshape(self._count, self._size)
        entries = self._task.slopes(y, self._parameters)[:, self._size :]
        parts = [entries.ravel()[self._entries], self._linear.entries]
        if self._clearance is not None:
            slopes = self._clearance.slopes(y[:, : self._joints])
            parts.append(slopes[self._clearance.moved])
        return [self.values(x, p)[1], np.concatenate(parts)[self._jacobian_order]]

    def hessian(self, x: Array, p: Array, sigma: Array, lam: Array) -> list[Array]:
        """Entries of the Lagrangian's Hessian; by the joints differences of its exact gradient."""
        task, n, size, N = self._task, self._count, self._size, self._joints
        y, multipliers = x.reshape(n, size), np.zeros((n, len(task.bounds[0])))
        multipliers.flat[self._counted] = lam[: len(self._counted)]
        weighed = np.empty((n, size + 1 + multipliers.shape[1]))
        weighed[:, :size] = y
        weighed[:, size] = -sigma[0] / n if task.shared is None else 0.0
        weighed[:, size + 1 :] = multipliers
        moved = np.repeat(weighed, N + 1, axis=0).reshape(n, N + 1, -1)
        moved[:, np.arange(N), np.arange(N)] += self._difference
        P = self._parameters
        slopes = task.lagrangian(
            moved.reshape(n * (N + 1), -1), np.repeat(P, N + 1, axis=0)
        ).reshape(n, N + 1, size)
        columns = (slopes[:, :N] - slopes[:, N:]) / self._difference
        H = np.zeros((n, size, size))
        H[:, :N, :] = columns
        H[:, :N, :N] = (columns[:, :, :N] + columns[:, :, :N].swapaxes(1, 2)) / 2
        if len(task.curved[0]):
            H[:, task.curved[0], task.curved[1]] = task.rest(weighed, P)
        if self._clearance is not None:
            H[:, :N, :N] += self._clearance.bends(y[:, :N], lam[len(lam) - self._spaced :])
        bend = 2 * self._smoothing * sigma[0]
        q = np.arange(N)
        H[1:, q, q] += bend
        H[:-1, q, q] += bend
        i, j = self._local
        entries = np.concatenate([H[:, i, j].ravel(), np.full(N * (n - 1), -bend)])
        return [entries[self._hessian_order]]


def _compressed(
    height: int, width: int, rows: Indices, columns: Indices
) -> tuple[ca.Sparsity, Indices]:
    """A sparsity pattern of entries that are all different, and their order in it."""
    order = np.lexsort((rows, columns))
    pattern = ca.Sparsity.triplet(height, width, rows.tolist(), columns.tolist())
    assert pattern.nnz() == len(rows)
    return pattern, order
