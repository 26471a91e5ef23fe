"""Judging: combinations ranked by the objective itself, where a cheaper score has compared them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.poses import Array, Indices
from copose.posture.model import PostureModel
from copose.posture.search.screening import Screened, combined
from copose.posture.setting import Setting


@dataclass(frozen=True)
class JudgingOptions:
    """Numbers of combinations that are judged."""

    at_once: int = 256  # that linear programs judge at a time
    most: int = 4096  # the same, altogether
    enough: int = 4  # for each that is polished
    measured: int = 10  # the same, that are measured exactly where a climb is costly
    best: int = 16  # that go to better neighbours
    sweeps: int = 4  # how often they do


def judged(
    model: PostureModel,
    setting: Setting,
    postures: Sequence[Array],
    neighbours: Sequence[Indices],
    screened: Screened,
    most: int,
    options: JudgingOptions = JudgingOptions(),
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
        options: how many are judged.
    """
    if model.objective.summable and not model.feasibility.judged:
        return screened
    chosen, scores = screened.chosen[:0], screened.scores[:0]
    for first in range(0, len(screened.chosen), options.at_once):
        rows = slice(first, first + options.at_once)
        combinations, worth = screened.chosen[rows], screened.scores[rows]
        q = combined(postures, combinations)
        held = model.feasibility.held(setting, q)
        combinations, worth, q = combinations[held], worth[held], q[held]
        if not model.objective.summable and len(q):
            worth = model.estimates(setting, q)
        sound = np.isfinite(worth)
        chosen = np.vstack([chosen, combinations[sound]])
        scores = np.concatenate([scores, worth[sound]])
        if len(chosen) >= options.enough * most or rows.stop >= options.most:
            break
    order = np.argsort(-scores, kind="stable")
    chosen, scores = chosen[order], scores[order]
    if not model.objective.summable and len(chosen):
        best = slice(options.best)
        top = chosen[best], scores[best]
        top = _ascended(model, setting, postures, neighbours, *top, options.sweeps)
        chosen = np.vstack([top[0], chosen[options.best :]])
        scores = np.concatenate([top[1], scores[options.best :]])
    if model.objective.costly:
        chosen = chosen[: options.measured * most]
        scores = model.objectives(setting, combined(postures, chosen))
    order = np.argsort(-scores, kind="stable")
    return Screened(chosen[order], scores[order], screened.combinations)


def _ascended(
    model: PostureModel,
    setting: Setting,
    postures: Sequence[Array],
    neighbours: Sequence[Indices],
    chosen: Indices,
    scores: Array,
    sweeps: int,
) -> tuple[Indices, Array]:
    """Combinations, (count, K), exchanged for better ones with a neighbouring posture of one arm.

    The score that compared them first may have its maxima elsewhere.
    """
    for _ in range(sweeps):
        exchanged = [chosen]
        for i, near in enumerate(neighbours):
            for column in near[chosen[:, i]].T:
                other = chosen.copy()
                other[:, i] = column
                exchanged.append(other)
        every = np.stack(exchanged[1:], axis=1) if len(exchanged) > 1 else chosen[:, None]
        q = combined(postures, every.reshape(-1, chosen.shape[1]))
        worth = model.estimates(setting, q)
        if model.feasibility.judged:
            worth = np.where(model.feasibility.held(setting, q), worth, -np.inf)
        worth = np.where(np.isfinite(worth), worth, -np.inf).reshape(every.shape[:2])
        best = worth.argmax(axis=1)
        rows = np.arange(len(chosen))
        better = worth[rows, best] > scores
        if not better.any():
            break
        chosen = np.where(better[:, None], every[rows, best], chosen)
        scores = np.where(better, worth[rows, best], scores)
    return chosen, scores
