"""Which combinations of the arms' postures are worth polishing.

With the object held still G is made of sums over the arms, and a term depends on the joints of one
arm alone. So each posture of an arm is evaluated once, and arms meet only in sums of a few numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from copose.capability import HoldingTorque, symmetric, upper_triangle
from copose.cell.cell import Cell
from copose.kernels import Kernel
from copose.objectives.ellipsoid_measures import EllipsoidMeasure, Objective
from copose.poses import Array, Indices, Mask

# Rows of a table of pairs that are evaluated at once are chosen to stay within a cache.
_AT_ONCE = 8192
_SWEEPS = 12
_UNHELD = 1e300
# Entries of a table that are asked for at a time whether they are allowed, and at most; and how
# many that stand out are enough.
_LOOKED_AT, _MOST_LOOKED_AT, _STANDING_OUT = 512, 16384, 256
# Where there are more than two arms: combinations that allowed exchanges improve, and exchanges
# that are asked for at a time.
_IMPROVED, _EXCHANGED = 16, 64


class Score:
    """The objective, or what stands in for it, as a function of the sums of the arms' terms.

    Attributes:
        value: kernel of the sums, (s,), and of what is given: postures are compared by it. Where
            arms at rest must hold the object the sums of `HoldingTorque` follow the objective's,
            and what torque limits certainly cannot hold is worth −10³⁰⁰.
        slope: kernel of the objective's sums alone and of what is given: the value and its
            derivatives by them, (1 + s,).
        gram: kernel of the upper triangle of G, where the objective measures an ellipsoid.
    """

    def __init__(self, cell: Cell, objective: Objective, numbers: int) -> None:
        """Write down the score of a cell for an objective with so many parameters."""
        space, axes = cell.system.space, cell.problem.axes
        sums = ca.SX.sym("sums", objective.sums.size(space))
        inertia, symbols = ca.SX.sym("M_o", space.m * (space.m + 1) // 2), ca.SX.sym("n", numbers)
        weight = ca.SX.sym("weight", len(space.balance))
        M_o = symmetric(inertia, space.m)
        value = objective.score(sums, M_o, symbols, axes)
        given = ca.vertcat(inertia, weight, symbols)
        self.slope = Kernel(sums, given, ca.vertcat(value, ca.gradient(value, sums)))
        self.gram = None
        if isinstance(objective, EllipsoidMeasure):
            self.gram = Kernel(sums, given, upper_triangle(objective.gram(sums, M_o, axes)))
        if cell.problem.constraints.static_torque:
            held = ca.SX.sym("held", HoldingTorque().size(space))
            most = sum(arm.n for arm in cell.arms) ** 0.5
            sinks = HoldingTorque.norm(held, weight) > most
            value = ca.if_else(sinks, -_UNHELD, value)
            sums = ca.vertcat(sums, held)
        self.value = Kernel(sums, given, value)

    @property
    def all(self) -> tuple[Kernel, ...]:
        """Its kernels."""
        return (
            (self.value, self.slope) if self.gram is None else (self.value, self.slope, self.gram)
        )


@dataclass(frozen=True, eq=False)
class Screened:
    """What screening found.

    Attributes:
        chosen: combinations that no exchange of one arm's posture for a neighbouring one improves,
            best first, as indices, (count, K).
        scores: of them, (count,).
        combinations: how many were evaluated.
    """

    chosen: Indices
    scores: Array
    combinations: int


def screen(
    score: Score,
    given: Array,
    terms: Sequence[Array],
    neighbours: Sequence[Indices],
    rng: np.random.Generator,
    starts: int,
    allowed: Callable[[Indices], Mask] | None = None,
) -> Screened:
    """The locally best combinations of the arms' postures.

    One arm and pairs are screened in full. Where there are more arms, random combinations are
    improved by exchanging one arm's posture after the other for the best there is.

    Args:
        score: of the sums.
        given: M_o and the objective's numbers, as the score's kernels take them.
        terms: by arm, of each of its postures, (count_i, s).
        neighbours: by arm, indices of the postures next to each, (count_i, k).
        rng: draws the combinations to start from.
        starts: how many of them.
        allowed: says of combinations, (count, K), which are; None where all are.
    """
    if len(terms) > 2:
        found = _exchanged(score, given, terms, rng, starts)
        return found if allowed is None else _sifted(score, given, terms, rng, found, allowed)
    table = _table(score, given, terms)
    if allowed is not None:
        return _standing_out(table, neighbours, allowed)
    best = np.isfinite(table)
    for axis, near in enumerate(neighbours):
        along = np.moveaxis(table, axis, 0)
        for column in near.T:
            best &= np.moveaxis(~(along < along[column]), 0, axis)
    chosen = np.argwhere(best)
    return _ranked(chosen, table[best], table.size)


def _standing_out(
    table: Array, neighbours: Sequence[Indices], allowed: Callable[[Indices], Mask]
) -> Screened:
    """The best allowed entries that no allowed neighbour exceeds.

    In descending order: what may exceed an entry has been looked at before it. What is not looked
    at until enough stand out is worth less than these.
    """
    usable = np.flatnonzero(np.isfinite(table.ravel()) & (table.ravel() > -_UNHELD))
    order = usable[np.argsort(-table.ravel()[usable], kind="stable")]
    found = np.zeros(table.shape, dtype=bool)
    chosen: list[Indices] = []
    for first in range(0, min(len(order), _MOST_LOOKED_AT), _LOOKED_AT):
        entries = np.column_stack(np.unravel_index(order[first : first + _LOOKED_AT], table.shape))
        entries = entries[allowed(entries)]
        found[tuple(entries.T)] = True
        worth = table[tuple(entries.T)]
        best = np.ones(len(entries), dtype=bool)
        for axis, near in enumerate(neighbours):
            for column in near[entries[:, axis]].T:
                other = entries.copy()
                other[:, axis] = column
                best &= ~(found[tuple(other.T)] & (table[tuple(other.T)] > worth))
        chosen.append(entries[best])
        if sum(map(len, chosen)) >= _STANDING_OUT:
            break
    every = np.vstack([np.zeros((0, table.ndim), dtype=np.intp), *chosen])
    return Screened(every, table[tuple(every.T)], table.size)


def _sifted(
    score: Score,
    given: Array,
    terms: Sequence[Array],
    rng: np.random.Generator,
    screened: Screened,
    allowed: Callable[[Indices], Mask],
) -> Screened:
    """The allowed ones, with random combinations that are, improved by allowed exchanges alone."""
    counts = [len(mine) for mine in terms]
    drawn = rng.integers(0, counts, (_LOOKED_AT * len(counts), len(counts)))
    some = np.unique(np.vstack([screened.chosen[:_MOST_LOOKED_AT], drawn]), axis=0)
    some = some[allowed(some)]

    def scores(chosen: Indices) -> Array:
        sums = np.sum([mine[k] for mine, k in zip(terms, chosen.T, strict=True)], axis=0)
        return _table(score, given, [sums]) if len(chosen) else np.zeros(0)

    ranked = _ranked(some, scores(some), 0)
    best, seen = ranked.chosen[:_IMPROVED].copy(), [ranked.chosen]
    for _ in range(_SWEEPS):
        before = best.copy()
        for row in best:
            for k, count in enumerate(counts):
                others = np.tile(row, (count, 1))
                others[:, k] = np.arange(count)
                worth = scores(others)
                order = np.argsort(-worth, kind="stable")
                order = order[worth[order] > worth[row[k]]][:_EXCHANGED]
                fine = order[allowed(others[order])] if len(order) else order
                if len(fine):
                    row[k] = fine[0]
        seen.append(best.copy())
        if np.array_equal(best, before):
            break
    every = np.unique(np.vstack(seen), axis=0)
    return _ranked(every, scores(every), screened.combinations + len(some))


def _table(score: Score, given: Array, terms: Sequence[Array]) -> Array:
    """Scores of all postures of one arm, (count,), or of all pairs, (count_1, count_2)."""
    if len(terms) == 1:
        return _cleaned(score.value(terms[0], given)[:, 0])
    one, other = terms
    values = np.empty((len(one), len(other)))
    rows = max(1, _AT_ONCE // len(other))
    for first in range(0, len(one), rows):
        sums = one[first : first + rows, None] + other[None]
        flat = score.value(sums.reshape(-1, sums.shape[2]), given)
        values[first : first + rows] = flat.reshape(sums.shape[:2])
    return _cleaned(values)


def _exchanged(
    score: Score, given: Array, terms: Sequence[Array], rng: np.random.Generator, starts: int
) -> Screened:
    counts = [len(mine) for mine in terms]
    chosen = rng.integers(0, counts, (starts, len(counts)))
    evaluated = 0
    seen = chosen[:0]
    for _ in range(_SWEEPS):
        before = chosen.copy()
        for k, mine in enumerate(terms):
            # Combinations that differ in this arm alone become the same.
            others = np.delete(chosen, k, axis=1)
            distinct, where = np.unique(others, axis=0, return_inverse=True)
            rest = sum(
                term[column]
                for term, column in zip(
                    (t for j, t in enumerate(terms) if j != k), distinct.T, strict=True
                )
            )
            top = _table(score, given, [np.asarray(rest), mine]).argmax(axis=1)
            chosen[:, k] = top[where.ravel()]
            evaluated += len(distinct) * len(mine)
        # Not only where the exchanges end: most starts end in the same few combinations.
        seen = np.unique(np.vstack([seen, chosen]), axis=0)
        if np.array_equal(chosen, before):
            break
    sums = np.asarray(sum(mine[column] for mine, column in zip(terms, seen.T, strict=True)))
    return _ranked(seen, _table(score, given, [sums]), evaluated)


def _cleaned(values: Array) -> Array:
    return np.where(np.isfinite(values), values, -np.inf)


def _ranked(chosen: Indices, scores: Array, combinations: int) -> Screened:
    usable = np.isfinite(scores) & (scores > -_UNHELD)
    order = np.argsort(-scores[usable], kind="stable")
    return Screened(chosen[usable][order], scores[usable][order], combinations)
