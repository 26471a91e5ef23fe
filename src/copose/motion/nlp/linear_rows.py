"""Linear constraints between knots: speed limits, finite differences, shared variables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.motion.nlp.knot import KnotNlp
from copose.poses import Array, Indices


@dataclass(frozen=True, eq=False)
class LinearRows:
    """Sparse linear constraints, lower ≤ A x ≤ upper, by the entries of A."""

    rows: Indices  # of the entries
    columns: Indices  # alike
    entries: Array  # of A
    lower: Array  # by row
    upper: Array  # alike
    names: tuple[tuple[str, int], ...]  # by row, what it is and at which knot

    def values(self, x: Array) -> Array:
        """A x, by row."""
        terms = self.entries * x[self.columns]
        return np.asarray(
            np.bincount(self.rows, weights=terms, minlength=len(self.lower)), dtype=float
        )


@dataclass(frozen=True)
class StepOptions:
    """Options of the longest step of a joint between two knots."""

    longest: float = 0.35  # rad or m, with as many knots as follow
    knots: int = 25
    shrink: float = 0.6  # power of the number of knots by which the step shrinks


def longest_step(count: int, options: StepOptions = StepOptions()) -> float:
    """The farthest that a joint may go between two of so many knots, rad or m.

    The chain is closed at knots alone: without this a motion would jump from branch to branch
    between them. With more knots joints may be faster, and jumps are squeezed out.
    """
    return float(options.longest * (options.knots / count) ** options.shrink)


def motion_rows(
    task: KnotNlp, count: int, speeds: Array, duration: float, *, returns: bool
) -> LinearRows:
    """Rows of a motion: steps, speed limits, and what ties rates and shared variables of the knots.

    Args:
        task: the program at a knot.
        count: of knots.
        speeds: limits of the joints, (N,).
        duration: s; where the shortest is sought, the one that its stretch multiplies.
        returns: whether the last knot is the first.
    """
    builder = Builder(count, task.size)
    _add_steps(builder, task, count, speeds, duration)
    if "slopes" in task.slices:
        _add_differences(builder, task, count)
    if task.shared is not None:
        builder.chain(task.shared, task.slices[task.shared])
    if returns:
        q = np.arange(task.joints)
        builder.add("return", [0], [(0, q, 1.0), (count - 1, q, -1.0)], 0.0, 0.0)
    return builder.rows()


def _add_steps(builder: Builder, task: KnotNlp, count: int, speeds: Array, duration: float) -> None:
    """Steps no longer than the longest, nor than speed limits allow in the time between knots."""
    pairs, most, reach = range(count - 1), longest_step(count), speeds * duration / (count - 1)
    stretched = task.shared == "stretch"
    slow = np.isfinite(reach) if stretched else reach < most
    free, limited = (np.flatnonzero(mask) for mask in (~slow | stretched, slow))
    builder.add("step", pairs, [(1, free, 1.0), (0, free, -1.0)], -most, most)
    ahead, behind, reach = (1, limited, 1.0), (0, limited, -1.0), reach[limited]
    if not stretched:
        builder.add("speed", pairs, [ahead, behind], -reach, reach)
        return
    stretch = np.full(len(limited), task.slices["stretch"].start)
    builder.add("speed", pairs, [ahead, behind, (0, stretch, -reach)], -np.inf, 0.0)
    builder.add("speed", pairs, [ahead, behind, (0, stretch, reach)], 0.0, np.inf)


def _add_differences(builder: Builder, task: KnotNlp, count: int) -> None:
    """Slopes and bends of the knots as finite differences; nothing moves at the ends."""
    step, inner = 1.0 / (count - 1), range(1, count - 1)
    q = np.arange(task.joints)
    slope, bend = task.slices["slopes"].start + q, task.slices["bends"].start + q
    builder.add(
        "slopes", inner, [(0, slope, 1.0), (1, q, -0.5 / step), (-1, q, 0.5 / step)], 0.0, 0.0
    )
    builder.add(
        "bends", inner,
        [(0, bend, step), (1, q, -1 / step), (0, q, 2 / step), (-1, q, -1 / step)], 0.0, 0.0,
    )  # fmt: skip
    for k, neighbour in ((0, 1), (count - 1, -1)):
        builder.add("slopes", [k], [(0, slope, 1.0)], 0.0, 0.0)
        builder.add(
            "bends", [k], [(0, bend, step), (neighbour, q, -2 / step), (0, q, 2 / step)], 0.0, 0.0
        )


class Builder:
    """A collector of linear rows over the knots' variables."""

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
        """Add a row for every knot and variable: lower ≤ Σ factor · variable ≤ upper.

        Args:
            name: of the rows.
            knots: at which they stand.
            terms: how many knots ahead, which variables there, and their factors.
            lower: bound.
            upper: alike.
        """
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
        """Add rows with which a variable is the same at all knots."""
        one = np.array([part.start])
        self.add(name, range(self._count - 1), [(1, one, 1.0), (0, one, -1.0)], 0.0, 0.0)

    def rows(self) -> LinearRows:
        """Everything that was added."""
        rows, columns, entries = map(np.concatenate, zip(*self._parts, strict=True))
        lower, upper = np.concatenate(self._lower), np.concatenate(self._upper)
        return LinearRows(rows, columns, entries, lower, upper, tuple(self._names))
