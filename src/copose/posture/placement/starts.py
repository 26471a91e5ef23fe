"""Starts of climbs over everything: the best combinations of the arms' postures at a placement."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from copose.poses import Array, Indices
from copose.posture.local.multistart import differing
from copose.posture.model import PostureModel
from copose.posture.optimum import LocalOptimum
from copose.posture.placement.nearby_postures import NearbyPostures
from copose.posture.placement.placed import FreePoses, Placed
from copose.posture.search.clear_samples import ArmPostures
from copose.posture.search.effort import EFFORTS, Effort, PlacementOptions
from copose.posture.search.global_search import sampled, search
from copose.posture.search.outcome import SearchOutcome
from copose.posture.search.screening import combined, screen
from copose.posture.setting import Setting
from copose.progress import hushed
from copose.self_motion.sampling import ArmSample


class PlacementStarts:
    """Searches for postures at one placement after another.

    Attributes:
        weights: of the cases' objectives.
        newton: whether Newton steps climb from the starts, so that none are climbed from here.
        searches: all searches of postures.
        tried: placements.
        closed: of them, where every arm holds the object in every case.
    """

    def __init__(
        self,
        model: PostureModel,
        weights: Sequence[float],
        seed: int,
        options: PlacementOptions,
        *,
        newton: bool,
    ) -> None:
        """Nothing is tried yet."""
        self._model, self._seed, self._options = model, seed, options
        self.weights, self.newton = weights, newton
        self._postures = NearbyPostures(model, seed)
        self.searches: list[SearchOutcome] = []
        self.tried = self.closed = 0

    def searched(
        self, xs: FreePoses, settings: Sequence[Setting]
    ) -> tuple[tuple[SearchOutcome, ...], list[Placed]]:
        """Searches for postures alone at a placement, by case, and the best combinations."""
        outcomes = []
        for setting in settings:
            # The whole is told of, not each of its searches.
            with hushed():
                outcomes.append(search(self._model, setting, self._seed, EFFORTS["normal"]))
            self._postures.add(setting, outcomes[-1].samples)
        return tuple(outcomes), self._starts(xs, outcomes, self._options.of_each)

    def glanced(self, xs: FreePoses, settings: Sequence[Setting]) -> list[Placed]:
        """The best combinations of postures that are continued from a placement near this one."""
        outcomes = []
        for setting in settings:
            with hushed():
                outcomes.append(self._combined(setting, self._postures.at(setting), self._glance))
            if not outcomes[-1].optima:
                break
        return self._starts(xs, outcomes, self._options.of_each)

    def anew(self, end: Placed, settings: Sequence[Setting]) -> list[Placed]:
        """The same where a climb has ended, of postures that are drawn anew, and its end with some
        of them in exchange for its own.
        """
        outcomes, exchanged, normal = [], list[Placed](), EFFORTS["normal"]
        for k, setting in enumerate(settings):
            with hushed():
                samples = sampled(self._model, setting, self._seed, normal)
                outcomes.append(self._combined(setting, samples, normal))
            if not outcomes[-1].optima:
                break
            if self.newton:
                exchanged += self._exchanged(end, k, setting, outcomes[-1])
        return self._starts(end.x, outcomes, self._options.of_each_end) + exchanged

    @property
    def _glance(self) -> Effort:
        """Effort at each placement where programs climb."""
        low = EFFORTS["low"]
        polished = low.polished if self._model.objective.smooth else self._options.glanced
        return replace(low, polished=polished, insistence=0)

    def _combined(
        self, setting: Setting, samples: tuple[ArmSample, ...], effort: Effort
    ) -> SearchOutcome:
        """The best combinations of postures that differ; climbed from where only programs climb."""
        model, options = self._model, self._options
        if not self.newton:
            return search(model, setting, self._seed, effort, samples)
        if len(samples) < len(model.arms) or not all(len(sample.closed) for sample in samples):
            return SearchOutcome(samples)
        arms = ArmPostures.of(samples)
        terms = [model.terms(setting, i, q) for i, q in enumerate(arms.postures)]
        rng, starts = np.random.default_rng([self._seed, 10]), EFFORTS["low"].starts
        best = screen(model.score, setting.given, terms, arms.neighbours, rng, starts)
        q = combined(arms.postures, best.chosen[: options.looked_through])
        chosen = differing(setting.cell, q, options.differing, options.of_each)
        # What is compared may stand in for the objective.
        smooth = model.objective.smooth
        values = best.scores[chosen] if smooth else model.objectives(setting, q[chosen])
        optima = [
            LocalOptimum(q[row], float(value), 1)
            for row, value in zip(chosen, values, strict=True)
            if np.isfinite(value)
        ]
        return SearchOutcome(samples, best.combinations, optima=tuple(optima))

    def _starts(self, xs: FreePoses, outcomes: Sequence[SearchOutcome], most: int) -> list[Placed]:
        """Starts at a placement from so many of the best postures of every case, best first."""
        self.tried += 1
        self.searches += outcomes
        if len(outcomes) < len(xs) or not all(each.optima for each in outcomes):
            return []
        self.closed += 1
        choices = self._choices(outcomes, most)
        each = zip(self.weights, outcomes, choices.T, strict=True)
        weighted = [
            weight * np.array([optimum.objective for optimum in outcome.optima])[column]
            for weight, outcome, column in each
        ]
        values = np.sum(weighted, axis=0)
        best = np.argsort(-values, kind="stable")[: most * len(outcomes)]
        q = [
            tuple(outcome.optima[j].q for outcome, j in zip(outcomes, choices[row], strict=True))
            for row in best
        ]
        return [Placed(xs, q_row, float(values[row])) for q_row, row in zip(q, best, strict=True)]

    def _choices(self, outcomes: Sequence[SearchOutcome], most: int) -> Indices:
        """Indices of an optimum of every case, (count, C), of those among the best of their case.

        What is best in one case alone need not be where all are served best. Where all combinations
        would be too many only one case at a time has another than its best.
        """
        counts = [min(len(each.optima), most) for each in outcomes]
        if len(outcomes) <= self._options.multiplied:
            return np.indices(counts).reshape(len(counts), -1).T
        one = np.eye(len(counts), dtype=np.intp)
        others = [j * one[k] for k, count in enumerate(counts) for j in range(1, count)]
        return np.vstack([np.zeros_like(one[:1]), *others])

    def _exchanged(
        self, end: Placed, k: int, setting: Setting, outcome: SearchOutcome
    ) -> Iterator[Placed]:
        """An end with other postures in case k: the best of all arms, and of one arm at a time the
        best for what the others have.

        Of two elbows either flipped alone may make a worse optimum than both.
        """
        model, options, weight = self._model, self._options, self.weights[k]
        parts = model.split(end.q[k][None])
        terms = [model.terms(setting, i, q)[0] for i, q in enumerate(parts)]
        now = float(model.score.value(np.sum(terms, axis=0)[None], setting.given)[0, 0])

        def with_other(q: Array, score: float) -> Placed:
            every = (*end.q[:k], q, *end.q[k + 1 :])
            return Placed(end.x, every, end.value + weight * (score - now))

        if len(end.q) > 1:
            yield from (with_other(o.q, o.objective) for o in outcome.optima)
        edges = np.cumsum([0, *(q.shape[1] for q in parts)])
        for i, sample in enumerate(outcome.samples):
            sums = model.terms(setting, i, sample.closed) + np.sum(terms, axis=0) - terms[i]
            scores = model.score.value(sums, setting.given)[:, 0]
            scores[~np.isfinite(scores)] = -np.inf
            best = ~(scores[:, None] < scores[sample.neighbours]).any(axis=1)
            order = np.argsort(-scores, kind="stable")
            order = order[(best & (scores > -np.inf))[order]]
            q = np.repeat(end.q[k][None], len(order), axis=0)
            q[:, edges[i] : edges[i + 1]] = sample.closed[order]
            known = end.q[k][None]
            for row in differing(setting.cell, q, options.other, options.exchanged, known):
                yield with_other(q[row], float(scores[order[row]]))
