"""Normals of a zonotope's facets by minors, of many zonotopes at once.

A facet is parallel to m − 1 generators, and its normal is their generalised cross product: the
minors of order m − 1 of their matrix. Minors grow column by column (Laplace's expansion along the
last), and those of two groups of columns are multiplied into those of both (the same along
several): far fewer operations than a decomposition for each choice of generators.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import combinations

import numpy as np

from copose.poses import Array, Indices


@dataclass(frozen=True, eq=False)
class _Level:
    """Minors of order k on all choices of k rows, in terms of those of order k − 1."""

    rest: Indices  # without one of the rows, among those of order k − 1, (choices, k)
    row: Indices  # that row, (choices, k)
    sign: Array  # of its entry in the last column, (choices, k)


@cache
def _levels(m: int) -> tuple[_Level, ...]:
    """Minors of order 2 … m − 1 of matrices with m rows."""
    levels = []
    for k in range(2, m):
        number = {rows: n for n, rows in enumerate(combinations(range(m), k - 1))}
        chosen = list(combinations(range(m), k))
        rest = [[number[rows[:p] + rows[p + 1 :]] for p in range(k)] for rows in chosen]
        sign = np.broadcast_to([(-1.0) ** (k - 1 - p) for p in range(k)], (len(chosen), k))
        levels.append(_Level(np.array(rest), np.array(chosen), sign))
    return tuple(levels)


def _expanded(minors: Array, column: Array, level: _Level) -> Array:
    """Minors with one column more, (choices, …), from those without, and the column, (m, …)."""
    shape = (-1, *(1,) * (minors.ndim - 1))
    added = np.zeros((len(level.row), *np.broadcast_shapes(minors.shape[1:], column.shape[1:])))
    for rest, row, sign in zip(level.rest.T, level.row.T, level.sign.T, strict=True):
        added += minors[rest] * (column[row] * sign.reshape(shape))
    return added


def cross(columns: Array) -> Array:
    """Generalised cross products of m − 1 columns, (m − 1, m, …): (m, …), perpendicular to each."""
    m = columns.shape[1]
    minors = columns[0] if m > 1 else np.ones((1, *columns.shape[2:]))
    for level, column in zip(_levels(m), columns[1:], strict=True):
        minors = _expanded(minors, column, level)
    # The rows that a minor leaves out come in reverse order.
    signs = (-1.0) ** np.arange(m).reshape(-1, *(1,) * (minors.ndim - 1))
    return np.asarray(minors[::-1] * signs) if m > 1 else minors


@dataclass(frozen=True, eq=False)
class _Product:
    """The normals of which k generators are of the first group, and the others of the second."""

    k: int
    left: Indices  # rows of the minors of the first group, (m, terms)
    right: Indices  # rows of those of the second, (m, terms)
    sign: Array  # (m, 1, terms)


@dataclass(frozen=True, eq=False)
class FacetNormals:
    """The normals of all facets of zonotopes with N generators in m dimensions.

    Attributes:
        choices: the generators that a facet is parallel to, (k, m − 1).
    """

    m: int
    n: int
    choices: Indices

    @classmethod
    def of(cls, m: int, n: int) -> FacetNormals:
        """The choices, in the order of the normals."""
        half, first = n // 2, []
        for k in range(m):
            left, right = combinations(range(half), k), combinations(range(half, n), m - 1 - k)
            rest = list(right)
            first += [one + other for one in left for other in rest]
        return cls(m, n, np.array(first, dtype=np.intp).reshape(-1, m - 1))

    def __call__(self, generators: Array) -> Array:
        """Normals, (count, m, k), not of unit length, of generators, (count, m, N)."""
        half = self.n // 2
        left, right = _all_minors(generators[:, :, :half]), _all_minors(generators[:, :, half:])
        parts = []
        for product in _products(self.m):
            one, other = left[product.k], right[self.m - 1 - product.k]
            if one.shape[2] and other.shape[2]:
                first = one[:, product.left].swapaxes(2, 3) * product.sign
                normals = first @ other[:, product.right]
                parts.append(normals.reshape(len(normals), self.m, -1))
        return np.concatenate(parts, axis=2)


@cache
def _products(m: int) -> tuple[_Product, ...]:
    """Normals from the minors of two groups of columns."""
    products = []
    for k in range(m):
        number, other = (
            {rows: n for n, rows in enumerate(combinations(range(m), size))}
            for size in (k, m - 1 - k)
        )
        left, right, sign = [], [], []
        for out in range(m):
            kept = [row for row in range(m) if row != out]
            chosen = list(combinations(kept, k))
            rest = [tuple(row for row in kept if row not in rows) for rows in chosen]
            left.append([number[rows] for rows in chosen])
            right.append([other[rows] for rows in rest])
            orders = [(out, *rows, *others) for rows, others in zip(chosen, rest, strict=True)]
            sign.append([_parity(order) for order in orders])
        products.append(_Product(k, np.array(left), np.array(right), np.array(sign)[:, None]))
    return tuple(products)


def _parity(order: tuple[int, ...]) -> float:
    """The sign of a permutation."""
    return (-1.0) ** sum(a > b for a, b in combinations(order, 2))


@cache
def _grown(n: int, k: int) -> tuple[Indices, Indices]:
    """Choices of k of n columns: the number of each without its last column, and that column."""
    number = {chosen: i for i, chosen in enumerate(combinations(range(n), k - 1))}
    chosen = list(combinations(range(n), k))
    rest = np.array([number[each[:-1]] for each in chosen], dtype=np.intp)
    return rest, np.array([each[-1] for each in chosen], dtype=np.intp)


def _all_minors(V: Array) -> list[Array]:
    """Minors of order 0 … m − 1 of matrices, (count, m, n): (count, rows, columns) each."""
    count, m, n = V.shape
    columns = V.transpose(1, 2, 0)
    minors = [np.ones((1, 1, count)), columns]
    for k, level in enumerate(_levels(m), start=2):
        rest, last = _grown(n, k)
        minors.append(_expanded(minors[-1][:, rest], columns[:, last], level))
    return [each.transpose(2, 0, 1) for each in minors[:m]]
