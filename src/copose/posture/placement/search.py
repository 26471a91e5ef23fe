"""Search where more than joints is free: placements are sampled, then all is climbed at once.

At every sample of the free coordinates the arms' postures are continued from a placement near it
and combined as if nothing else were free. The best combinations start climbs over everything, and
where these end the postures are searched anew.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from copose.cell.cell import Cell
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.posture.optimum import LocalSolve
from copose.posture.placement.differences import Differences
from copose.posture.placement.nlp import PlacementNlp
from copose.posture.placement.placed import FreePoses, Placed
from copose.posture.placement.samples import PlacementSampler
from copose.posture.placement.starts import PlacementStarts
from copose.posture.search.effort import Effort
from copose.posture.search.outcome import SearchOutcome
from copose.posture.setting import Setting
from copose.posture.solvers.placed_newton import PlacedPolisher
from copose.progress import attained, heed, stage


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
        fixed = any(arm.fixed for arm in cell.arms)
        self._newton = model.placed is not None and not model.feasibility.constraints and not fixed
        self._starter = PlacementStarts(
            model, self.weights, seed, self._options, newton=self._newton
        )
        self._differences = Differences(cell, self._freedom.upper - self._freedom.lower)
        self._first: tuple[SearchOutcome, ...] = ()
        self._starts: list[Placed] = []
        self._ends: list[Placed] = []
        self._revisited: list[FreePoses] = []
        self._polished = 0

    @cached_property
    def nominal(self) -> FreePoses:
        """The file's placement, clipped into the ranges, and held by fixed arms."""
        return self._sampler.nominal

    def setting(self, k: int, x: Array) -> Setting:
        """Case k with everything moved by x, (d,)."""
        return self._program.setting(k, x)

    def run(self) -> PlacementOutcome:
        """Search, climb, and search again where that ended."""
        options, starter = self._options, self._starter
        stage("searching where the file has everything")
        self._first, self._starts = starter.searched(self.nominal, self._settings(self.nominal))
        for xs in () if self._hopeless(self._first) else self._placements():
            stage("trying placements", min(starter.tried, self._most), self._most)
            self._starts += starter.glanced(xs, self._settings(xs))
        self._starts.sort(key=lambda start: -start.value)
        for turn, near in enumerate(options.nearer if self._newton else ()):
            self._starts += self._starts_around(self._starts, near, turn)
            self._starts.sort(key=lambda start: -start.value)
        most = options.raced if self._newton else options.climbed // self._cost
        self._climb(self._distinct(self._starts, most), options.race)
        for _ in range(options.rounds if self._ends else 0):
            best = self._gathered(self._ends)
            stage("searching where placements ended")
            starts = self._starts_near(best)
            new = self._differences.unknown(starts, self._ends, options.same)
            self._climb(new, options.last_race)
            if not max(end.value for end in self._ends) > best[0].value + self._same.objective:
                break
        return self._outcome(self._certified(self._gathered(self._ends)))

    @property
    def so_far(self) -> PlacementOutcome:
        """Outcome of a run that has to end: with starts that were not climbed from yet."""
        return self._outcome(self._gathered([*self._ends, *self._starts]))

    def _outcome(self, optima: Sequence[Placed]) -> PlacementOutcome:
        return PlacementOutcome(
            optima=tuple(optima),
            first=self._first,
            searches=tuple(self._starter.searches),
            tried=self._starter.tried,
            closed=self._starter.closed,
            polished=self._polished,
            best_sample=max((start.value for start in self._starts), default=None),
            failures=tuple(self._program.failures),
        )

    def polish(self, start: Placed) -> Placed:
        """The local optimum of everything that is free; never anything worse than its start."""
        self._polished += 1
        return self._program.climb(start)

    def _certified(self, optima: Sequence[Placed]) -> list[Placed]:
        """The optima, of which programs have gone on from the best that Newton steps stalled at."""
        if not self._model.objective.smooth or not self._newton or not optima:
            return list(optima)
        least, ends = optima[0].value - self._options.near_best, list(optima)
        for k, end in enumerate(optima[: self._options.certified]):
            if not end.converged and end.value > least:
                ends[k] = self.polish(end)
        return self._gathered(ends)

    def _climb(self, starts: Sequence[Placed], race: Sequence[tuple[int, int]]) -> None:
        if self._newton and starts:
            starts = self._raced(starts, race)
        for k, start in enumerate(starts):
            stage("polishing placements", k, len(starts))
            self._ends.append(self.polish(start))
            attained(self._ends[-1].value)

    def _raced(self, starts: Sequence[Placed], race: Sequence[tuple[int, int]]) -> list[Placed]:
        """Climbs by Newton steps from all starts at once.

        Returns:
            Ends that programs have to go on from: the best where the score is a stand-in.
        """
        stage("climbing", 0, len(starts))
        self._polished += len(starts)
        program, smooth = self._program, self._model.objective.smooth
        variables = np.array([program.stacked(start) for start in starts])
        ended = self._polisher.polish(variables, race)
        order = np.argsort(-ended.value, kind="stable")
        ends = [
            replace(
                program.placed(ended.q[row], float(ended.value[row])),
                count=int(ended.met[row]), converged=bool(ended.converged[row]),
            )
            for row in order[np.isfinite(ended.error[order])]
        ]  # fmt: skip
        if not smooth:
            return self._distinct(ends, self._options.finished)
        self._ends += ends
        attained(max((end.value for end in self._ends), default=-np.inf))
        return []

    def _distinct(self, starts: Sequence[Placed], most: int) -> list[Placed]:
        """The first starts that differ from one another, only a few of each placement."""
        options = self._options
        return self._differences.distinct(starts, options.differing, most, options.of_each)

    @cached_property
    def _polisher(self) -> PlacedPolisher:
        return self._model.placed_polisher(self._settings(self.nominal), self.weights)

    def _settings(self, xs: FreePoses) -> list[Setting]:
        return [self.setting(k, x) for k, x in enumerate(xs)]

    @property
    def _most(self) -> int:
        """Placements that are searched."""
        options = self._options
        costly = 1 if self._model.objective.smooth else options.costly
        return max(8, min(options.one << max(0, len(self._freedom) - 1), options.most) // costly)

    @property
    def _cost(self) -> int:
        """Cost of a program here, in programs for the volume of one case."""
        return len(self._cases) * (1 if self._model.objective.smooth else self._options.costly)

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
        grid = sampler.grid
        scattered = sampler.scattered(options.insistence * self._most, 0)
        for k, x in enumerate(np.vstack([grid, scattered])):
            if k >= len(grid) + self._most and self._starter.closed > self._most // 2:
                return
            heed()
            yield from sampler.held(sampler.everywhere(x))
        if self._starter.closed > options.few * self._most:
            return
        rng = np.random.default_rng([self._seed, 7])
        for x in sampler.scattered(self._most, 1):
            heed()
            yield from sampler.closed(x, rng)

    def _starts_around(self, starts: Sequence[Placed], near: float, turn: int) -> list[Placed]:
        """Starts of placements around the best so far, within this share of the ranges.

        Where arms come near singular postures the best has peaks that are narrow.
        """
        options, found = self._options, list[Placed]()
        best = self._differences.of_places(starts, options.one_place, options.refined)
        for k, start in enumerate(best):
            heed()
            drawn = self._sampler.around(start.x, options.between, near, k + turn * len(best))
            for xs in drawn:
                found += self._starter.glanced(xs, self._settings(xs))
        return found

    def _starts_near(self, ends: Sequence[Placed]) -> list[Placed]:
        """Starts where the best climbs ended, and the best of some around the first of them."""
        options, starts, around = self._options, list[Placed](), list[Placed]()
        best = self._differences.of_places(ends, options.one_place, options.ends)
        for k, end in enumerate(end for end in best if not self._searched_at(end.x)):
            settings = self._settings(end.x)
            if k < options.searched:
                starts += self._starter.anew(end, settings)
            else:
                starts += self._starter.glanced(end.x, settings)
            self._revisited.append(end.x)
        for xs in self._sampler.around(ends[0].x, options.around, options.near, 0):
            around += self._starter.glanced(xs, self._settings(xs))[:1]
        around.sort(key=lambda start: -start.value)
        return starts + around[: options.best_around]

    def _searched_at(self, xs: FreePoses) -> bool:
        """True where postures were searched at this very placement after a climb ended there."""
        least = self._options.same * (self._freedom.upper - self._freedom.lower)
        return any((np.abs(np.subtract(xs, known)) <= least).all() for known in self._revisited)

    def _gathered(self, ends: Sequence[Placed]) -> list[Placed]:
        """Distinct ends, best first, with how many ended in each."""
        return self._differences.gathered(ends, self._options.same, self._same.objective)
