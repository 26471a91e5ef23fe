"""Search where more than joints is free: placements are sampled, then all is climbed at once.

At every sample of the free coordinates the postures are searched as if nothing else were free; the
best of them start the posture program over everything, and where that ends they are searched anew.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from copose.cell.cell import Cell
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.posture.placement.nlp import PlacementNlp
from copose.posture.placement.placed import FreePoses, Placed
from copose.posture.placement.samples import PlacementSampler
from copose.posture.search.effort import EFFORTS, Effort
from copose.posture.search.global_search import search
from copose.posture.search.outcome import SearchOutcome
from copose.posture.setting import Setting
from copose.posture.solvers.nlp import LocalSolve
from copose.progress import attained, heed, hushed, stage
from copose.selection import far_apart


@dataclass(frozen=True, eq=False)
class PlacementOutcome:
    """Optima that a search over placements found, and what it tried.

    Attributes:
        optima: distinct, best first.
        first: by case, what was found at the file's pose, clipped into the ranges.
        searches: all searches of postures.
        tried: placements.
        closed: of them, where every arm holds the object in every case.
        polished: starts of the program over everything.
        best_sample: the largest value of a placement before anything but its joints was polished.
        failures: how polishing failed.
    """

    optima: tuple[Placed, ...]
    first: tuple[SearchOutcome, ...] = ()
    searches: tuple[SearchOutcome, ...] = ()
    tried: int = 0
    closed: int = 0
    polished: int = 0
    best_sample: float | None = None
    failures: tuple[LocalSolve, ...] = ()


class PlacementSearch:
    """Search for postures and everything else that is free.

    Attributes:
        weights: of the cases' objectives.
    """

    def __init__(self, model: PostureModel, cell: Cell, seed: int, effort: Effort) -> None:
        """A search in a cell of the model, with its object where it is; nothing is tried yet."""
        self._model, self._seed = model, seed
        self._options, self._same = effort.placing, effort.climbing.same
        self._freedom = model.places.freedom
        self._cases = cell.cases
        self.weights = [case.weight for case in cell.problem.cases] or [1.0]
        self._sampler = PlacementSampler(model.places, self._cases, seed)
        self._program = PlacementNlp(model, self._cases, self.weights)
        self._first: tuple[SearchOutcome, ...] = ()
        self._starts: list[Placed] = []
        self._ends: list[Placed] = []
        self._searches: list[SearchOutcome] = []
        self._tried = self._closed = self._polished = 0

    @cached_property
    def nominal(self) -> FreePoses:
        """The file's placement, clipped into the ranges, and held by fixed arms."""
        return self._sampler.nominal

    def setting(self, k: int, x: Array) -> Setting:
        """Case k with everything moved by x, (d,)."""
        return self._program.setting(k, x)

    def run(self) -> PlacementOutcome:
        """Search, climb, and search again where that ended."""
        options = self._options
        stage("searching where the file has everything")
        self._first, self._starts = self._at(self.nominal, EFFORTS["normal"])
        self._tried = 1
        for xs in () if self._hopeless(self._first) else self._placements():
            stage("trying placements", min(self._tried, self._most), self._most)
            self._starts += self._at(xs, self._glance)[1]
            self._tried += 1
        self._starts.sort(key=lambda start: -start.value)
        self._climb(self._distinct(self._starts, options.climbed // self._cost))
        for _ in range(options.rounds if self._ends else 0):
            best = self._gathered(self._ends)[: options.ends if len(self._cases) > 1 else 1]
            stage("searching where placements ended")
            starts = self._starts_near(best)
            known, least = self._ends, options.same
            self._climb([s for s in starts if all(self._apart(s, e) > least for e in known)])
            if not max(end.value for end in self._ends) > best[0].value + self._same.objective:
                break
        return self._outcome(self._gathered(self._ends))

    @property
    def so_far(self) -> PlacementOutcome:
        """Outcome of a run that has to end: with starts that were not climbed from yet."""
        return self._outcome(self._gathered([*self._ends, *self._starts]))

    def _outcome(self, optima: Sequence[Placed]) -> PlacementOutcome:
        return PlacementOutcome(
            optima=tuple(optima),
            first=self._first,
            searches=tuple(self._searches),
            tried=self._tried,
            closed=self._closed,
            polished=self._polished,
            best_sample=max((start.value for start in self._starts), default=None),
            failures=tuple(self._program.failures),
        )

    def polish(self, start: Placed) -> Placed:
        """The local optimum of everything that is free; never anything worse than its start."""
        self._polished += 1
        return self._program.climb(start)

    def _climb(self, starts: Sequence[Placed]) -> None:
        for k, start in enumerate(starts):
            stage("polishing placements", k, len(starts))
            self._ends.append(self.polish(start))
            attained(self._ends[-1].value)

    @property
    def _most(self) -> int:
        """Placements that are searched."""
        options = self._options
        costly = 1 if self._model.objective.smooth else options.costly
        count = options.one << max(0, len(self._freedom) - 1)
        return max(8, min(count, options.most) // costly)

    @property
    def _cost(self) -> int:
        """Cost of a program here, in programs for the volume of one case."""
        return len(self._cases) * (1 if self._model.objective.smooth else self._options.costly)

    @property
    def _glance(self) -> Effort:
        """Effort at each placement."""
        low = EFFORTS["low"]
        polished = low.polished if self._model.objective.smooth else self._options.glanced
        return replace(low, polished=polished, insistence=0)

    def _hopeless(self, first: Sequence[SearchOutcome]) -> bool:
        """True where an arm misses its grasp that nothing free could bring nearer."""
        movable = {c.arm for c in self._freedom.coordinates}
        return None not in movable and any(
            len(sample.closed) == 0 and i not in movable
            for outcome in first
            for i, sample in enumerate(outcome.samples)
        )

    def _placements(self) -> Iterator[FreePoses]:
        """Placements over all ranges; more, where the arms can close, if they hardly ever do."""
        if not len(self._freedom):
            return
        sampler, options = self._sampler, self._options
        for k, x in enumerate(sampler.scattered(options.insistence * self._most, 0)):
            if k >= self._most and self._closed > self._most // 2:
                return
            heed()
            yield from sampler.held(sampler.everywhere(x))
        if self._closed > options.few * self._most:
            return
        rng = np.random.default_rng([self._seed, 7])
        for x in sampler.scattered(self._most, 1):
            heed()
            yield from sampler.closed(x, rng)

    def _starts_near(self, best: Sequence[Placed]) -> list[Placed]:
        """Starts where the best climbs ended, and the best of some around the first of them."""
        options, starts, around = self._options, list[Placed](), list[Placed]()
        for end in best:
            starts += self._at(end.x, EFFORTS["normal"])[1]
            self._tried += 1
        for xs in self._sampler.around(best[0].x, options.around, options.near):
            around += self._at(xs, self._glance)[1][:1]
            self._tried += 1
        around.sort(key=lambda start: -start.value)
        return starts + around[: options.best_around]

    def _at(self, xs: FreePoses, effort: Effort) -> tuple[tuple[SearchOutcome, ...], list[Placed]]:
        """Searches for postures alone with everything moved, by case, and the best of them."""
        outcomes: list[SearchOutcome] = []
        for k, x in enumerate(xs):
            setting = self.setting(k, x)
            # The whole is told of, not each of its searches.
            with hushed():
                outcomes.append(search(self._model, setting, self._seed, effort))
            if not outcomes[-1].optima and effort.insistence == 0:
                break
        self._searches += outcomes
        if len(outcomes) < len(xs) or not all(each.optima for each in outcomes):
            return tuple(outcomes), []
        self._closed += 1
        starts = []
        for choice in self._choices(outcomes):
            optima = [each.optima[j] for each, j in zip(outcomes, choice, strict=True)]
            value = sum(w * o.objective for w, o in zip(self.weights, optima, strict=True))
            starts.append(Placed(xs, tuple(o.q for o in optima), float(value)))
        starts.sort(key=lambda start: -start.value)
        return tuple(outcomes), starts[: self._options.of_each * len(outcomes)]

    def _choices(self, outcomes: Sequence[SearchOutcome]) -> list[tuple[int, ...]]:
        """Indices of an optimum of every case, of those among the best of their case.

        What is best in one case alone need not be where all are served best. Where all combinations
        would be too many only one case at a time has another than its best.
        """
        counts = [range(min(len(each.optima), self._options.of_each)) for each in outcomes]
        if len(outcomes) <= self._options.multiplied:
            return list(product(*counts))
        best = (0,) * len(outcomes)
        return [best] + [
            (*best[:k], j, *best[k + 1 :]) for k, count in enumerate(counts) for j in count[1:]
        ]

    def _apart(self, one: Placed, other: Placed) -> float:
        """Largest difference of two: of joints, rad or m, and of free coordinates over ranges."""
        cell = self._cases[0]
        joints = max(cell.distances(a[None], b)[0] for a, b in zip(one.q, other.q, strict=True))
        span = self._freedom.upper - self._freedom.lower
        moved = max(
            float((np.abs(a - b) / span).max(initial=0.0))
            for a, b in zip(one.x, other.x, strict=True)
        )
        return max(float(joints), moved)

    def _distinct(self, starts: Sequence[Placed], most: int) -> list[Placed]:
        """The first starts that differ from one another, only a few of each placement."""

        def far(start: Placed, taken: Sequence[Placed]) -> bool:
            # Starts of one placement tend to end alike.
            alike = sum(other.x is start.x for other in taken)
            return alike < self._options.of_each and all(
                self._apart(start, other) > self._options.differing for other in taken
            )

        return far_apart(starts, far, most)

    def _gathered(self, ends: Sequence[Placed]) -> list[Placed]:
        """Distinct ends, best first, with how many ended in each."""
        optima: list[Placed] = []
        for end in sorted(ends, key=lambda end: -end.value):
            for j, known in enumerate(optima):
                if (
                    abs(known.value - end.value) < self._same.objective
                    and self._apart(known, end) < self._options.same
                ):
                    optima[j] = replace(known, count=known.count + 1)
                    break
            else:
                optima.append(end)
        return optima
