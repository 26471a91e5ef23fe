"""Linear rows over the variables of all knots: what ties neighbours, what is the same at all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.poses import Array, Indices


@dataclass(frozen=True, eq=False)
class LinearRows:
    """Linear rows: lower ≤ A x ≤ upper, by their entries."""

    rows: Indices
    columns: Indices
    entries: Array
    lower: Array
    upper: Array
    names: tuple[tuple[str, int], ...]


class Builder:
    """Collects linear rows over the knots' variables."""

    def __init__(self, count: int, size: int) -> None:
        self._count, self._size, self._height = count, size, 0
        self._parts: list[tuple[Indices, Indices, Array]] = []
        self._lower: list[Array] = []
        self._upper: list[Array] = []
        self._names: list[tuple[str, int]] = []

    def add(
        self,
        name: str,
        knots: Sequence[int] | range,
        terms: Sequence[tuple[int, Indices, Array | float]],
        lower: Array | float,
        upper: Array | float,
    ) -> None:
        """A row per knot and variable: Σ factor · (variable of the knot some knots on)."""
        ks = np.array(knots, dtype=np.intp)[:, None]
        many = len(terms[0][1])
        rows = self._height + np.arange(ks.size * many)
        for ahead, columns, factor in terms:
            places = ((ks + ahead) * self._size + columns).ravel()
            entries = np.tile(np.broadcast_to(factor, many), ks.size)
            self._parts.append((rows, places, np.asarray(entries, dtype=float)))
        self._lower.append(np.tile(np.broadcast_to(lower, many), ks.size))
        self._upper.append(np.tile(np.broadcast_to(upper, many), ks.size))
        self._names += [(name, int(k)) for k in ks.ravel() for _ in range(many)]
        self._height += ks.size * many

    def chain(self, name: str, part: slice) -> None:
        """A variable is the same at all knots."""
        one = np.array([part.start])
        self.add(name, range(self._count - 1), [(1, one, 1.0), (0, one, -1.0)], 0.0, 0.0)

    def rows(self) -> LinearRows:
        """All of them."""
        nothing = (np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp), np.zeros(0))
        parts = [nothing, *self._parts]
        return LinearRows(
            np.concatenate([part[0] for part in parts]),
            np.concatenate([part[1] for part in parts]),
            np.concatenate([part[2] for part in parts]),
            np.concatenate([np.zeros(0), *self._lower]),
            np.concatenate([np.zeros(0), *self._upper]),
            tuple(self._names),
        )
