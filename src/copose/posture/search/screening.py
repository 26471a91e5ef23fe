"""Screening: the combinations of the arms' postures that are locally best by a score.

With the object held still G is made of sums over the arms, and a term depends on the joints of one
arm alone. So each posture of an arm is evaluated once, and arms meet only in sums of a few numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from copose.poses import Array, Indices, Mask
from copose.posture.score import RULED_OUT, Score


@dataclass(frozen=True)
class ScreeningOptions:
    """Numbers of combinations that are looked at."""

    at_once: int = 8192  # entries of a table evaluated together, so as to stay within a cache
    asked: int = 512  # entries that are asked at a time whether they are allowed
    most_asked: int = 16384  # the same, altogether
    standing_out: int = 256  # allowed entries without a better neighbour that are enough
    sweeps: int = 12  # of exchanging one arm's posture after the other
    improved: int = 16  # combinations of more than two arms that allowed exchanges improve
    exchanged: int = 64  # exchanges that are asked at a time whether they are allowed


@dataclass(frozen=True, eq=False)
class Screened:
    """Combinations that screening has chosen.

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
    options: ScreeningOptions = ScreeningOptions(),
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
        allowed: a test of combinations, (count, K); None where all are allowed.
        options: how many combinations are looked at.
    """
    if len(terms) > 2:
        screened = _exchanged(score, given, terms, rng, starts, options)
        if allowed is None:
            return screened
        return _sifted(score, given, terms, rng, screened, allowed, options)
    table = _table(score, given, terms, options.at_once)
    if allowed is not None:
        return _standing_out(table, neighbours, allowed, options)
    best = np.isfinite(table)
    for axis, near in enumerate(neighbours):
        along = np.moveaxis(table, axis, 0)
        if near.shape[1]:
            best &= np.moveaxis(along >= along[near].max(axis=1), 0, axis)
    chosen = np.argwhere(best)
    return _ranked(chosen, table[best], table.size)


def combined(postures: Sequence[Array], chosen: Indices) -> Array:
    """Stacked joints of combinations, (count, N)."""
    return np.hstack([q[rows] for q, rows in zip(postures, chosen.T, strict=True)])


def _standing_out(
    table: Array,
    neighbours: Sequence[Indices],
    allowed: Callable[[Indices], Mask],
    options: ScreeningOptions,
) -> Screened:
    """The best allowed entries that no allowed neighbour exceeds.

    In descending order: what may exceed an entry has been looked at before it. What is not looked
    at until enough stand out is worth less than these.
    """
    usable = np.flatnonzero(np.isfinite(table.ravel()) & (table.ravel() > RULED_OUT))
    order = usable[np.argsort(-table.ravel()[usable], kind="stable")]
    known = np.zeros(table.shape, dtype=bool)
    chosen: list[Indices] = []
    for first in range(0, min(len(order), options.most_asked), options.asked):
        asked = order[first : first + options.asked]
        entries = np.column_stack(np.unravel_index(asked, table.shape))
        entries = entries[allowed(entries)]
        known[tuple(entries.T)] = True
        worth = table[tuple(entries.T)]
        best = np.ones(len(entries), dtype=bool)
        for axis, near in enumerate(neighbours):
            for column in near[entries[:, axis]].T:
                other = entries.copy()
                other[:, axis] = column
                best &= ~(known[tuple(other.T)] & (table[tuple(other.T)] > worth))
        chosen.append(entries[best])
        if sum(map(len, chosen)) >= options.standing_out:
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
    options: ScreeningOptions,
) -> Screened:
    """The allowed ones, with random combinations that are, improved by allowed exchanges alone."""
    counts = [len(rows) for rows in terms]
    drawn = rng.integers(0, counts, (options.asked * len(counts), len(counts)))
    tried = np.unique(np.vstack([screened.chosen[: options.most_asked], drawn]), axis=0)
    tried = tried[allowed(tried)]

    def scores(chosen: Indices) -> Array:
        sums = np.sum([rows[k] for rows, k in zip(terms, chosen.T, strict=True)], axis=0)
        return _table(score, given, [sums], options.at_once) if len(chosen) else np.zeros(0)

    ranked = _ranked(tried, scores(tried), 0)
    best, seen = ranked.chosen[: options.improved].copy(), [ranked.chosen]
    for _ in range(options.sweeps):
        before = best.copy()
        for row in best:
            for k, count in enumerate(counts):
                exchanges = np.tile(row, (count, 1))
                exchanges[:, k] = np.arange(count)
                worth = scores(exchanges)
                order = np.argsort(-worth, kind="stable")
                order = order[worth[order] > worth[row[k]]][: options.exchanged]
                fine = order[allowed(exchanges[order])] if len(order) else order
                if len(fine):
                    row[k] = fine[0]
        seen.append(best.copy())
        if np.array_equal(best, before):
            break
    every = np.unique(np.vstack(seen), axis=0)
    return _ranked(every, scores(every), screened.combinations + len(tried))


def _table(score: Score, given: Array, terms: Sequence[Array], at_once: int) -> Array:
    """Scores of all postures of one arm, (count,), or of all pairs, (count_1, count_2)."""
    if len(terms) == 1:
        return _cleaned(score.value(terms[0], given)[:, 0])
    one, other = terms
    values = np.empty((len(one), len(other)))
    rows = max(1, at_once // len(other))
    for first in range(0, len(one), rows):
        sums = one[first : first + rows, None] + other[None]
        flat = score.value(sums.reshape(-1, sums.shape[2]), given)
        values[first : first + rows] = flat.reshape(sums.shape[:2])
    return _cleaned(values)


def _exchanged(
    score: Score,
    given: Array,
    terms: Sequence[Array],
    rng: np.random.Generator,
    starts: int,
    options: ScreeningOptions,
) -> Screened:
    """Random combinations improved by exchanging one arm's posture after the other."""
    counts = [len(rows) for rows in terms]
    chosen = rng.integers(0, counts, (starts, len(counts)))
    evaluated = 0
    seen = chosen[:0]
    for _ in range(options.sweeps):
        before = chosen.copy()
        for k, arm_terms in enumerate(terms):
            # Combinations that differ in this arm alone become the same.
            fixed = np.delete(chosen, k, axis=1)
            distinct, where = np.unique(fixed, axis=0, return_inverse=True)
            rest = sum(
                term[column]
                for term, column in zip(
                    (t for j, t in enumerate(terms) if j != k), distinct.T, strict=True
                )
            )
            both = [np.asarray(rest), arm_terms]
            top = _table(score, given, both, options.at_once).argmax(axis=1)
            chosen[:, k] = top[where.ravel()]
            evaluated += len(distinct) * len(arm_terms)
        # Not only where the exchanges end: most starts end in the same few combinations.
        seen = np.unique(np.vstack([seen, chosen]), axis=0)
        if np.array_equal(chosen, before):
            break
    sums = np.asarray(sum(rows[column] for rows, column in zip(terms, seen.T, strict=True)))
    return _ranked(seen, _table(score, given, [sums], options.at_once), evaluated)


def _cleaned(values: Array) -> Array:
    return np.where(np.isfinite(values), values, -np.inf)


def _ranked(chosen: Indices, scores: Array, combinations: int) -> Screened:
    usable = np.isfinite(scores) & (scores > RULED_OUT)
    order = np.argsort(-scores[usable], kind="stable")
    return Screened(chosen[usable][order], scores[usable][order], combinations)
