"""Combinations judged by what torque limits allow, where a cheaper score has compared them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from copose.poses import Array, Indices
from copose.posture.model import PostureModel, Setting
from copose.posture.search.screening import Screened

# Combinations that linear programs judge at a time, and at most; and how many for each that is
# polished are enough.
_JUDGED, _MOST_JUDGED, _ENOUGH = 256, 4096, 4
# Where a climb is dear so many for each that is polished are measured exactly.
_MEASURED = 10
# The best of them go to better neighbours, so many times.
_BEST, _SWEEPS = 16, 4


def judged(
    model: PostureModel,
    setting: Setting,
    postures: Sequence[Array],
    neighbours: Sequence[Indices],
    screened: Screened,
    most: int,
) -> Screened:
    """The best combinations by the objective itself, where another score has compared them; and of
    them those that hold the object, where they must.

    Args:
        model: judges them.
        setting: where the object is.
        postures: by arm, (count_i, n_i).
        neighbours: by arm, indices of the postures next to each, (count_i, k).
        screened: combinations by another score.
        most: that will be polished.
    """
    if model.newton and not model.static:
        return screened
    chosen, scores = screened.chosen[:0], screened.scores[:0]
    for first in range(0, len(screened.chosen), _JUDGED):
        rows = slice(first, first + _JUDGED)
        some, worth = screened.chosen[rows], screened.scores[rows]
        q = _combined(postures, some)
        held = model.held(setting, q)
        some, worth, q = some[held], worth[held], q[held]
        if not model.newton and len(q):
            worth = model.estimates(setting, q)
        sound = np.isfinite(worth)
        chosen = np.vstack([chosen, some[sound]])
        scores = np.concatenate([scores, worth[sound]])
        if len(chosen) >= _ENOUGH * most or first + _JUDGED >= _MOST_JUDGED:
            break
    order = np.argsort(-scores, kind="stable")
    chosen, scores = chosen[order], scores[order]
    if not model.newton and len(chosen):
        top = _ascended(model, setting, postures, neighbours, chosen[:_BEST], scores[:_BEST])
        chosen = np.vstack([top[0], chosen[_BEST:]])
        scores = np.concatenate([top[1], scores[_BEST:]])
    if model.dear:
        chosen = chosen[: _MEASURED * most]
        scores = model.objectives(setting, _combined(postures, chosen))
    order = np.argsort(-scores, kind="stable")
    return Screened(chosen[order], scores[order], screened.combinations)


def _ascended(
    model: PostureModel,
    setting: Setting,
    postures: Sequence[Array],
    neighbours: Sequence[Indices],
    chosen: Indices,
    scores: Array,
) -> tuple[Indices, Array]:
    """Combinations, (count, K), exchanged for better ones with a neighbouring posture of one arm.

    The score that compared them first may have its maxima elsewhere.
    """
    for _ in range(_SWEEPS):
        beside = [chosen]
        for i, near in enumerate(neighbours):
            for column in near[chosen[:, i]].T:
                other = chosen.copy()
                other[:, i] = column
                beside.append(other)
        every = np.stack(beside[1:], axis=1) if len(beside) > 1 else chosen[:, None]
        q = _combined(postures, every.reshape(-1, chosen.shape[1]))
        worth = model.estimates(setting, q)
        if model.static:
            worth = np.where(model.held(setting, q), worth, -np.inf)
        worth = np.where(np.isfinite(worth), worth, -np.inf).reshape(every.shape[:2])
        best = worth.argmax(axis=1)
        rows = np.arange(len(chosen))
        better = worth[rows, best] > scores
        if not better.any():
            break
        chosen = np.where(better[:, None], every[rows, best], chosen)
        scores = np.where(better, worth[rows, best], scores)
    return chosen, scores


def _combined(postures: Sequence[Array], chosen: Indices) -> Array:
    """Stacked joints of combinations, (count, N)."""
    return np.hstack([mine[k] for mine, k in zip(postures, chosen.T, strict=True)])
