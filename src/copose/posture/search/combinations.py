"""Combinations of the arms' postures: screened, climbed from, and combined anew."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from copose.poses import Array, Indices, Mask
from copose.posture.local.multistart import LocalSearches, differing, gathered
from copose.posture.model import PostureModel
from copose.posture.search.clear_samples import ArmPostures, alone_clear, kept_apart
from copose.posture.search.effort import CombinationOptions, Effort
from copose.posture.search.outcome import SearchOutcome
from copose.posture.search.ranking import judged
from copose.posture.search.screening import Screened, combined, screen
from copose.posture.setting import Setting
from copose.progress import StoppedError, over, sheltered, stage
from copose.self_motion.sampling import ArmSample

Allowed: TypeAlias = Callable[[Indices], Mask]
"""Predicate of combinations of the arms' postures, by their indices, (count, K)."""


@dataclass(eq=False)
class Combinations:
    """One search over the combinations of the arms' postures, for as long as the call may go on.

    Attributes:
        climbs: local searches so far; grows.
        arms: postures of the arms that count.
        seed: of everything that is drawn.
        effort: how much is tried.
        allowed: predicate of combinations of these postures; without it, where bodies must keep a
            clearance, those are allowed that do.
        evaluated: how many combinations were.
        screened: the best by a score.
        bound: of the objective of all of them, from above; None where it is not known.
        starts: the best by the objective itself that differ, (count, N); None before it has
            compared them.
    """

    climbs: LocalSearches
    arms: ArmPostures
    seed: int
    effort: Effort
    allowed: Allowed | None = None
    evaluated: int = field(default=0, init=False)
    screened: Screened | None = field(default=None, init=False)
    bound: float | None = field(default=None, init=False)
    starts: Array | None = field(default=None, init=False)

    def search(self, samples: Sequence[ArmSample]) -> SearchOutcome:
        """The local optima that the best combinations lead to; samples are for the outcome."""
        with suppress(StoppedError):
            self._combine()
        with sheltered():
            starts = self._known_starts()
            self._add_stand_in(starts)
            first = self._model.objectives(self._setting, starts[:1]) if len(starts) else None
        optima = gathered(self._setting.cell, self.climbs.ends, self.climbs.options.same)
        return SearchOutcome(
            samples=tuple(samples),
            combinations=self.evaluated,
            best_sample=None if first is None else float(first[0]),
            bound=self.bound,
            starts=self.climbs.starts,
            optima=tuple(optima),
            met=tuple(optimum.count for optimum in optima),
            failures=tuple(self.climbs.failures),
            best=starts[0] if len(starts) else None,
        )

    @property
    def _model(self) -> PostureModel:
        return self.climbs.model

    @property
    def _setting(self) -> Setting:
        return self.climbs.setting

    @property
    def _options(self) -> CombinationOptions:
        return self.effort.combining

    @property
    def _spare(self) -> int:
        """Degrees of freedom to spare of all arms."""
        return sum(max(0, kernels.n - kernels.m) for kernels in self._model.arms)

    @property
    def _surfaces(self) -> bool:
        """True where arms have more than one degree of freedom to spare each, in the mean."""
        return self._spare > len(self.arms.postures)

    @property
    def _by_programs(self) -> bool:
        """True where linear programs judge combinations, and a climb takes few programs."""
        return not (self._model.objective.summable or self._model.objective.costly)

    @property
    def _most(self) -> int:
        """Combinations that are climbed from: a step in many dimensions takes many evaluations."""
        options = self._options
        part = min(1.0, options.plain_spare / max(self._spare, 1))
        most = max(options.fewest_starts, int(self.effort.polished * part))
        if self._surfaces:
            if self._model.objective.costly:
                return most * options.sampled_starts
            most *= options.surface_starts
        return most if self._model.objective.summable else most * options.kinked_starts

    def _combine(self) -> None:
        """Screen, judge and climb, then combine anew; fills what is known as it goes."""
        stage("comparing postures")
        postures = self.arms.postures
        rng = np.random.default_rng([self.seed, len(postures)])
        best = self._ranked(self.arms, rng, self.allowed, first=True)
        self.starts, scores = self._distinct(postures, best, self._most)
        self.climbs.add_promising(self.starts, scores)
        for _ in range(self._rounds if self.climbs.ends else 0):
            if not self._recombine(rng):
                break

    @property
    def _rounds(self) -> int:
        """Rounds of combining anew; none where all pairs of dense curves were compared."""
        kernels = self._model.arms
        dense = len(kernels) <= 2 and all(arm.n - arm.m <= 1 for arm in kernels)
        # Where another score has compared them the best pair may have looked like many.
        if dense and self._model.objective.summable:
            return 0
        # Where linear programs judge pairs they judge all of the best ends, once.
        return min(self.effort.rounds, 1) if self._by_programs else self.effort.rounds

    def _recombine(self, rng: np.random.Generator) -> bool:
        """Combine the ends of climbs anew and climb from the best; True where that gains.

        At a good combination every arm's posture is good for what the others add up to, and it was
        climbed to for another sum before.
        """
        model, climbs = self._model, self.climbs
        postures = self._end_postures()
        if not all(map(len, postures)):
            return False
        # None is next to another.
        arms = ArmPostures(postures, [np.zeros((len(q), 0), dtype=np.intp) for q in postures])
        screened = self._ranked(arms, rng)
        # Where kinks make what was climbed stand above all that was not, only the latter counts.
        known = None if model.objective.summable else climbs.known
        again, _ = self._distinct(postures, screened, max(1, self._most // 2), known)
        before = climbs.best
        climbs.add(climbs.unknown(again))
        return climbs.best > before + climbs.options.same.objective

    def _end_postures(self) -> list[Array]:
        """Postures of the best ends and responses to them by arm, (count_i, n_i).

        They are clear of all but the other arms.
        """
        model, setting, climbs = self._model, self._setting, self.climbs
        most, few, surfaces = self._most, self._by_programs, self._surfaces
        postures = climbs.postures(self._options.judged_ends if few else 2 * most)
        tried = most * self._options.surface_responses if surfaces else most
        for i, kernels in enumerate(() if few and not surfaces else model.arms):
            fixed = setting.cell.arms[i].fixed
            if len(postures) > 1 and kernels.n > kernels.m and not fixed:
                responses = climbs.responses(i, self.arms.postures[i], tried)
                postures[i] = np.vstack([postures[i], responses])
        if setting.bodies is not None:
            return [q[alone_clear(setting, i, q)] for i, q in enumerate(postures)]
        return postures

    def _ranked(
        self,
        arms: ArmPostures,
        rng: np.random.Generator,
        allowed: Allowed | None = None,
        *,
        first: bool = False,
    ) -> Screened:
        """The best combinations, compared by the objective itself or screened and then judged."""
        model, setting, postures = self._model, self._setting, arms.postures
        if setting.bodies is not None and allowed is None:
            allowed = kept_apart(setting, postures)
        ranked = model.objective.ranked(setting, postures, self._permitted(postures, allowed))
        if ranked is not None:
            self.evaluated += ranked.combinations
            if first:
                self.bound = ranked.bound
            return Screened(ranked.chosen, ranked.scores, ranked.combinations)
        screened = self._screened(arms, rng, allowed)
        if first:
            self.screened = screened
        return judged(model, setting, postures, arms.neighbours, screened, self._most)

    def _permitted(self, postures: Sequence[Array], allowed: Allowed | None) -> Allowed | None:
        """Predicate of combinations that are allowed and keep what is judged; None if all are."""
        feasibility, setting = self._model.feasibility, self._setting
        if not feasibility.judged:
            return allowed

        def permitted(chosen: Indices) -> Mask:
            kept = np.ones(len(chosen), dtype=bool) if allowed is None else allowed(chosen)
            kept[kept] = feasibility.held(setting, combined(postures, chosen[kept]))
            return kept

        return permitted

    def _screened(
        self, arms: ArmPostures, rng: np.random.Generator, allowed: Allowed | None
    ) -> Screened:
        model, setting, neighbours = self._model, self._setting, arms.neighbours
        terms = [model.terms(setting, i, q) for i, q in enumerate(arms.postures)]
        if model.feasibility.judged:
            # A combination that cannot be held may stand above a neighbour that can.
            neighbours = [near[:, :0] for near in neighbours]
        starts = self.effort.starts
        screened = screen(model.score, setting.given, terms, neighbours, rng, starts, allowed)
        self.evaluated += screened.combinations
        return screened

    def _distinct(
        self,
        postures: Sequence[Array],
        screened: Screened,
        most: int,
        known: Array | None = None,
    ) -> tuple[Array, Array]:
        """The best combinations that differ from one another, and from those known, in some joint.

        Returns:
            Stacked joints, (count, N), and scores, (count,).
        """
        options, cell = self._options, self._setting.cell
        q = combined(postures, screened.chosen[: options.looked_through * most])
        chosen = differing(cell, q, options.differing, most, known)
        return q[chosen], screened.scores[chosen]

    def _known_starts(self) -> Array:
        """The best starts, or of a comparison that was cut short a few of the best by score."""
        if self.starts is not None:
            return self.starts
        if self.screened is None:
            return np.zeros((0, sum(arm.n for arm in self._setting.cell.arms)))
        return self._distinct(self.arms.postures, self.screened, self.effort.measured)[0]

    def _add_stand_in(self, starts: Array) -> None:
        """Count the best start that is allowed among the ends where it is better than they.

        Where bodies are in the way a climb may fail, and where the call has to end there may have
        been none.
        """
        model, setting = self._model, self._setting
        if not len(starts) or (setting.bodies is None and not over()):
            return
        starts = starts[: self.effort.measured if over() else None]
        for start, value in zip(starts, model.objectives(setting, starts), strict=True):
            if value <= self.climbs.best:
                break
            if model.feasibility.allowed(setting, start[None])[0]:
                self.climbs.keep(start, value, climbs=0)
                break
