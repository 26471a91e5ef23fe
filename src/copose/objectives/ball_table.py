"""The largest ball of accelerations of all combinations of one or two arms' postures, with a bound.

A vector that bounds the radius of one combination bounds that of all: each combination whose
facets are enumerated lowers the bounds of its neighbours, and what stays below the best is never
looked at.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from copose.capability.residual_balls import ResidualBalls
from copose.objectives.objective import Ranked
from copose.poses import Array, Indices, Mask


@dataclass(frozen=True)
class TableOptions:
    """The search for the largest entry of a table."""

    first: int = 16  # entries whose facets bound all others at first
    at_once: int = 16  # entries that are evaluated together
    normals: int = 2  # facets of each that bound the others
    gap: float = 0.02  # of the best, relative, within which the bound has to come
    most: int = 768  # entries that are evaluated, at most
    asked: int = 256  # entries that are asked together whether they are allowed
    most_asked: int = 16384  # the same, altogether


def ranked(
    balls: ResidualBalls,
    allowed: Callable[[Indices], Mask] | None,
    options: TableOptions = TableOptions(),
) -> Ranked:
    """Combinations of one or two arms' postures, largest ball first, and a bound of all.

    Args:
        balls: of the arms' postures.
        allowed: predicate of combinations, (count, K); None where all are allowed.
        options: of the search.
    """
    table = _Table.of(balls, options)
    asked = np.full(table.upper.size, allowed is None)
    while len(table.open) and table.evaluated < options.most:
        order = table.open[np.argsort(-table.upper[table.open], kind="stable")]
        batch = order[: options.at_once]
        if allowed is None or asked[batch].all():
            table.evaluate(batch)
            continue
        unknown = order[: options.asked]
        unknown = unknown[~asked[unknown]]
        asked[unknown] = True
        table.rule_out(unknown[~allowed(table.entries(unknown))])
        if asked.sum() >= options.most_asked:
            break
    # What was never asked for is no answer.
    return table.ranked(asked)


@dataclass(eq=False)
class _Table:
    """Bounds of all entries from above, in a row.

    Attributes:
        upper: the bounds; of entries that were evaluated the radius, of what is ruled out −∞.
        exact: which were evaluated.
        open: entries that may be larger than the best by more than the gap.
    """

    balls: ResidualBalls
    options: TableOptions
    upper: Array
    exact: Mask
    open: Indices
    best: float = -np.inf
    evaluated: int = 0

    @classmethod
    def of(cls, balls: ResidualBalls, options: TableOptions) -> _Table:
        """Bounds by the facets of some entries all over the table."""
        size = int(np.prod(balls.counts))
        # Multiples of the golden section are spread evenly, however many they are.
        spread = np.unique((np.arange(options.first) * 0.6180339887498949 % 1 * size).astype(int))
        chosen = np.column_stack(np.unravel_index(spread, balls.counts))
        normals = balls.facets(chosen, options.normals).normals
        normals = normals.reshape(-1, normals.shape[2])
        upper = balls.table(normals[np.isfinite(normals).all(axis=1)]).ravel()
        upper = np.where(np.isnan(upper), -np.inf, upper)
        return cls(
            balls, options, upper, np.zeros(size, dtype=bool), np.flatnonzero(upper > -np.inf)
        )

    def entries(self, numbers: Indices) -> Indices:
        """Combinations, (count, K), by their numbers."""
        return np.column_stack(np.unravel_index(numbers, self.balls.counts))

    def evaluate(self, numbers: Indices) -> None:
        """Evaluate entries, and lower the bounds of those that are open."""
        facets = self.balls.facets(self.entries(numbers), self.options.normals)
        radii = np.where(np.isnan(facets.radii[:, 0]), -np.inf, facets.radii[:, 0])
        self.upper[numbers], self.exact[numbers] = radii, True
        self.best = max(self.best, float(radii.max()))
        self.evaluated += len(numbers)
        self._narrow()
        normals = facets.normals[np.isfinite(radii)].reshape(-1, facets.normals.shape[2])
        if len(self.open) and len(normals):
            bounds = self.balls.bounds(normals, self.entries(self.open))
            self.upper[self.open] = np.minimum(self.upper[self.open], bounds)
            self._narrow()

    def rule_out(self, numbers: Indices) -> None:
        """Entries that are not allowed."""
        self.upper[numbers] = -np.inf
        self._narrow()

    def _narrow(self) -> None:
        least = self.best + self.options.gap * abs(self.best) if self.evaluated else -np.inf
        self.open = self.open[~self.exact[self.open] & (self.upper[self.open] > least)]

    def ranked(self, allowed: Mask) -> Ranked:
        """Entries that are allowed, the evaluated before others that may be no better."""
        bound = float(self.upper.max(initial=-np.inf))
        lowered = bound - self.best if np.isfinite(self.best) else 0.0
        worth = np.where(self.exact, self.upper, self.upper - lowered)
        numbers = np.flatnonzero(allowed & np.isfinite(worth))
        # Of equal worth those that were evaluated come first.
        order = np.lexsort((~self.exact[numbers], -worth[numbers]))
        numbers = numbers[order]
        known = max(0.0, bound) if np.isfinite(bound) else None
        return Ranked(self.entries(numbers), worth[numbers], self.upper.size, known)
