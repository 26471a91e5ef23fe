"""The search where more than joints is free: placements are sampled, then all is polished at once.

At every sample of the free coordinates the postures are searched as if nothing else were free; the
best of them start the posture program over everything, and where that ends they are searched anew.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from itertools import product
from typing import TypeAlias

import numpy as np

from copose.cell.cell import Cell
from copose.objectives.objective import Cuts
from copose.poses import Array
from copose.posture.local.climb import SAME_OBJECTIVE
from copose.posture.local.nlp_cuts import NlpCuts
from copose.posture.model import PostureModel
from copose.posture.search.global_search import EFFORTS, Effort, Found, search
from copose.posture.setting import Setting
from copose.posture.solvers.constraint_generation import GenerationOptions, Step, generate
from copose.posture.solvers.nlp import Given, LocalSolve
from copose.progress import attained, heed, hushed, stage
from copose.robots import finite_range
from copose.selection import far_apart

# Placements that are searched with one free coordinate, twice as many with each more, and at most;
# postures that are polished. So many of them where a search takes many programs.
_PLACEMENTS = {"low": (8, 32), "normal": (32, 128), "high": (64, 512)}
_POLISHED = {"low": 24, "normal": 96, "high": 512}
_DEAR, _GLANCED = 2, 3
# Where hardly half of them let the arms close, so many times as many are drawn; and where that is
# of little use, others are looked for. Rounds of searching where polishing ended, with so many
# placements around it, within such a part of the ranges.
_INSIST = 3
_FEW, _ROUNDS, _AROUND, _NEAR = 0.25, 4, 8, 0.1
_OF_EACH, _ENDS, _BEST_AROUND = 4, 3, 2
# Cases of which all combinations of their best are told apart.
_MULTIPLIED = 4
_SAME, _UNLIKE, _LOSS = 1e-3, 0.3, 1e-9
# How often a program is solved with what it has run into.
_COLLISIONS = 4
# What scipy.stats loads, and itself.
_STATISTICS = "linalg", "sparse", "special", "spatial", "optimize", "interpolate", "stats"


Everywhere: TypeAlias = tuple[Array, ...]
"""The free coordinates of every case, (d,) each; the arms' are the same."""


@dataclass(frozen=True, eq=False)
class Placed:
    """Postures of all cases, with everything that is free.

    Attributes:
        x: where everything free is.
        q: by case, stacked joints, (N,).
        value: Σ weight · objective.
        count: how many starts ended here.
    """

    x: Everywhere
    q: tuple[Array, ...]
    value: float
    count: int = 1


@dataclass(frozen=True, eq=False)
class Placements:
    """What a search over placements found.

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
    first: tuple[Found, ...]
    searches: tuple[Found, ...]
    tried: int
    closed: int
    polished: int
    best_sample: float | None
    failures: tuple[LocalSolve, ...]


class PlacementSearch:
    """Searches the postures and everything else that is free."""

    def __init__(self, model: PostureModel, cell: Cell, seed: int, effort: str) -> None:
        """Nothing found yet; a cell of the model's, with its object where it is."""
        self._model, self._seed, self._effort = model, seed, effort
        self._places = model.places
        self._freedom = self._places.freedom
        self._cases = cell.cases
        self.weights = [case.weight for case in cell.problem.cases] or [1.0]
        self._first: tuple[Found, ...] = ()
        self._starts: list[Placed] = []
        self._ends: list[Placed] = []
        self._searches: list[Found] = []
        self._failures: list[LocalSolve] = []
        self._tried = self._closed = self._polished = 0

    @property
    def nominal(self) -> Everywhere:
        """Where the file has everything, clipped into the ranges, and held by fixed arms."""
        xs = self._same(self._freedom.nominal)
        return next(self._kept(xs), xs)

    def _same(self, x: Array) -> Everywhere:
        """The same free coordinates, (d,), in every case."""
        return (x,) * len(self._cases)

    @property
    def case_names(self) -> tuple[str, ...]:
        """One without a name where there are none."""
        return self._places.cases

    def setting(self, k: int, x: Array) -> Setting:
        """Case k with everything moved by x, (d,)."""
        return self._model.setting(self._freedom.at(self._cases[k], x))

    def run(self) -> Placements:
        """Search, polish, and search again where that ended."""
        stage("searching where the file has everything")
        self._first, self._starts = self._at(self.nominal, EFFORTS["normal"])
        self._tried = 1
        for xs in () if self._hopeless(self._first) else self._placements():
            stage("trying placements", min(self._tried, self._most), self._most)
            self._starts += self._at(xs, self._glance)[1]
            self._tried += 1
        self._starts.sort(key=lambda start: -start.value)
        chosen = self._distinct(self._starts, _POLISHED[self._effort] // self._cost)
        self._climb(chosen)
        for _ in range(_ROUNDS if self._ends else 0):
            best = self._gathered(self._ends)[: _ENDS if len(self._cases) > 1 else 1]
            stage("searching where placements ended")
            more = []
            for end in best:
                more += self._at(end.x, EFFORTS["normal"])[1]
                self._tried += 1
            around = []
            for xs in self._around(best[0].x):
                around += self._at(xs, self._glance)[1][:1]
                self._tried += 1
            around.sort(key=lambda start: -start.value)
            more += around[:_BEST_AROUND]
            self._climb(self._unlike(more, self._ends))
            if not max(end.value for end in self._ends) > best[0].value + SAME_OBJECTIVE:
                break
        return self._placements_of(self._gathered(self._ends))

    @property
    def so_far(self) -> Placements:
        """What a run that has to end has come to: also what was not polished yet."""
        return self._placements_of(self._gathered([*self._ends, *self._starts]))

    def _placements_of(self, optima: Sequence[Placed]) -> Placements:
        return Placements(
            optima=tuple(optima),
            first=self._first,
            searches=tuple(self._searches),
            tried=self._tried,
            closed=self._closed,
            polished=self._polished,
            best_sample=max((start.value for start in self._starts), default=None),
            failures=tuple(self._failures),
        )

    def _climb(self, starts: Sequence[Placed]) -> None:
        for k, start in enumerate(starts):
            stage("polishing placements", k, len(starts))
            self._ends.append(self.polish(start))
            attained(self._ends[-1].value)

    @property
    def _most(self) -> int:
        """Placements that are searched."""
        one, most = _PLACEMENTS[self._effort]
        dear = 1 if self._model.smooth else _DEAR
        return max(8, min(one << max(0, len(self._freedom) - 1), most) // dear)

    @property
    def _cost(self) -> int:
        """By how much a program here is dearer than one for the volume of one case."""
        return len(self._cases) * (1 if self._model.smooth else _DEAR)

    @property
    def _glance(self) -> Effort:
        """How much is searched at each placement."""
        polished = EFFORTS["low"].polished if self._model.smooth else _GLANCED
        return replace(EFFORTS["low"], polished=polished, insistence=0)

    def _hopeless(self, first: Sequence[Found]) -> bool:
        """Whether an arm misses its grasp that nothing free could bring nearer."""
        movable = {c.arm for c in self._freedom.coordinates}
        return None not in movable and any(
            len(sample.closed) == 0 and i not in movable
            for found in first
            for i, sample in enumerate(found.samples)
        )

    def _placements(self) -> Iterator[Everywhere]:
        """Placements over all ranges; more, where the arms can close, if they hardly ever do."""
        if not len(self._freedom):
            return
        for k, x in enumerate(self._drawn(_INSIST * self._most, 0)):
            if k >= self._most and self._closed > self._most // 2:
                return
            heed()
            yield from self._kept(self._same(x))
        if self._closed > _FEW * self._most:
            return
        rng = np.random.default_rng([self._seed, 7])
        for x in self._drawn(self._most, 1):
            heed()
            yield from self._reached(x, rng)

    def _drawn(self, count: int, turn: int) -> Array:
        """Evenly scattered over the ranges, (count, d)."""
        # All at once they take longer than a call may that has to end.
        for part in _STATISTICS:
            heed()
            import_module(f"scipy.{part}")
        from scipy.stats import qmc

        rng = np.random.default_rng([self._seed, 8, turn])
        points = qmc.Sobol(len(self._freedom), seed=rng).random_base2(int(np.log2(count - 1)) + 1)
        low, high = self._freedom.lower, self._freedom.upper
        return np.asarray(low + points[:count] * (high - low))

    def _around(self, xs: Everywhere) -> Iterator[Everywhere]:
        """Placements near one."""
        if not len(self._freedom):
            return
        rng = np.random.default_rng([self._seed, 9])
        low, high = self._freedom.lower, self._freedom.upper
        for step in rng.uniform(-_NEAR, _NEAR, (_AROUND, len(low))):
            yield from self._kept(tuple(np.clip(x + step * (high - low), low, high) for x in xs))

    def _kept(self, xs: Everywhere) -> Iterator[Everywhere]:
        """A placement, moved to where fixed arms hold the object; nothing where they cannot."""
        if not any(arm.fixed for arm in self._cases[0].arms) or not len(self._freedom):
            yield xs
            return
        found = self._places.held_by_fixed(self._cases, xs)
        if found is not None:
            yield found

    def _at(self, xs: Everywhere, effort: Effort) -> tuple[tuple[Found, ...], list[Placed]]:
        """What postures alone are worth with everything moved, best first."""
        found: list[Found] = []
        for k, here in enumerate(xs):
            setting = self.setting(k, here)
            # The whole is told of, not each of its searches.
            with hushed():
                found.append(search(self._model, setting, self._seed, effort))
            if not found[-1].optima and effort.insistence == 0:
                break
        self._searches += found
        if len(found) < len(xs) or not all(each.optima for each in found):
            return tuple(found), []
        self._closed += 1
        # What is best in one case alone need not be where all are served best: the best sums of
        # what is among the best of every case start too.
        counts = [range(min(len(each.optima), _OF_EACH)) for each in found]
        if len(found) <= _MULTIPLIED:
            choices = list(product(*counts))
        else:
            best = (0,) * len(found)
            choices = [best] + [
                (*best[:k], j, *best[k + 1 :]) for k, some in enumerate(counts) for j in some[1:]
            ]
        starts = []
        for choice in choices:
            optima = [each.optima[j] for each, j in zip(found, choice, strict=True)]
            value = sum(w * o.objective for w, o in zip(self.weights, optima, strict=True))
            starts.append(Placed(xs, tuple(o.q for o in optima), float(value)))
        starts.sort(key=lambda start: -start.value)
        return tuple(found), starts[: _OF_EACH * len(found)]

    def _reached(self, x: Array, rng: np.random.Generator) -> Iterator[Everywhere]:
        """A placement near x, (d,), at which random postures of all arms close, in every case."""
        from scipy.optimize import least_squares

        cells, places = self._cases, self._places
        closing = places.closing
        low, high = (
            np.concatenate([np.tile(np.concatenate(ends), len(cells)), free])
            for ends, free in zip(
                zip(*(finite_range(*limits) for limits in
                      zip(cells[0].lower, cells[0].upper, strict=True)), strict=True),
                places.bounds, strict=True,
            )
        )  # fmt: skip
        given = np.concatenate([self._freedom.numbers(cell) for cell in cells])
        start = rng.uniform(low, high)
        start[len(start) - places.size :] = places.joined([x] * len(cells))
        # Joints that do not move at all are no variables.
        moves = high > low
        whole = np.where(moves, start, low)

        def completed(some: Array) -> Array:
            whole[moves] = some
            return whole

        def residual(some: Array) -> Array:
            return np.array(closing(completed(some), given)[0]).ravel()

        def slope(some: Array) -> Array:
            return np.array(closing(completed(some), given)[1])[:, moves]

        end = least_squares(
            residual,
            np.clip(start[moves], low[moves] + 1e-9, high[moves] - 1e-9),
            jac=slope,
            bounds=(low[moves], high[moves]), max_nfev=60, xtol=1e-14, ftol=1e-14, gtol=1e-14,
        )  # fmt: skip
        if np.sqrt(2 * end.cost) <= 1e-6:
            found = places.parted(completed(end.x)[len(start) - places.size :])
            yield from self._kept(tuple(found))

    def polish(self, start: Placed) -> Placed:
        """Climb over everything that is free; never to anything worse.

        Demands that a run of IPOPT left out join the next. Where a run leads astray the next may
        go less far.
        """
        self._polished += 1
        limits = self._model.objective.piecewise
        options = GenerationOptions(
            rounds=12, free_rounds=3 if limits else 0, always_bounded=True, patient=True,
            stuck_way=1.0, last_rejection=12 if limits else 3, least_gain=SAME_OBJECTIVE / 10,
            gain_round=3,
        )  # fmt: skip

        def solve(here: Placed, cuts: list[Cuts], room: float) -> Step[Placed, list[Cuts]] | None:
            end = self._solved(here, cuts, room)
            if end is None:
                return None
            if not end.converged:
                self._failures.append(end)
                return None
            there = self._evaluated(end.q)
            way = float(np.abs(end.q - self._stacked(here)).max())
            return Step(there, there.value, way, self._tightened(there, cuts))

        def accepts(step: Step[Placed, list[Cuts]], best: float, _: bool) -> bool:
            return step.value > best - _LOSS * (1 + abs(best))

        return generate(start, start.value, self._demands(start), solve, accepts, options)

    def _stacked(self, placed: Placed) -> Array:
        return np.concatenate([*placed.q, self._places.joined(placed.x)])

    def _evaluated(self, end: Array) -> Placed:
        """The value of an end of the program."""
        size = self._places.size
        q = np.split(end[: len(end) - size], len(self._cases))
        x = self._places.parted(end[len(end) - size :])
        values = [
            self._model.objectives(self.setting(k, x[k]), mine[None])[0] for k, mine in enumerate(q)
        ]
        total = float(np.dot(self.weights, values))
        return Placed(tuple(x), tuple(q), total if np.isfinite(total) else -np.inf)

    def _demands(self, placed: Placed) -> list[Cuts]:
        """The demands of each case's program."""
        found = []
        for k, q in enumerate(placed.q):
            setting, parts = self.setting(k, placed.x[k]), self._model.split(q[None])
            found.append(setting.objective.cuts(setting, parts)[0])
        return found

    def _tightened(self, placed: Placed, demands: list[Cuts]) -> list[Cuts] | None:
        """Demands with those that a run left out; None where it left out none."""
        found = []
        for k, q in enumerate(placed.q):
            setting, parts = self.setting(k, placed.x[k]), self._model.split(q[None])
            found.append(setting.objective.more_cuts(setting, parts, demands[k]))
        if all(each is None for each in found):
            return None
        return [old if new is None else new for old, new in zip(demands, found, strict=True)]

    def _solved(self, here: Placed, demands: list[Cuts], room: float) -> LocalSolve | None:
        """One run of IPOPT over everything, with what it runs into kept apart."""
        model, freedom, cuts = self._model, self._freedom, NlpCuts(self._model)
        settings = [self.setting(k, x) for k, x in enumerate(here.x)]
        numbers, beside = [], []
        for k, (setting, q) in enumerate(zip(settings, here.q, strict=True)):
            mine, more = cuts.given(setting, q[None], [demands[k]])
            if not np.all(np.isfinite(more)):
                return None
            numbers.append(np.concatenate([*mine, setting.placement.inertia]))
            beside.append(more[0])
        places = [freedom.numbers(cell) for cell in self._cases]
        bounds = [setting.bounds for setting in settings]
        ends = self._places.bounds
        start = self._stacked(here)
        lower = np.concatenate([*(low for low, _ in bounds), ends[0]])
        upper = np.concatenate([*(high for _, high in bounds), ends[1]])
        lower, upper = np.maximum(lower, start - room), np.minimum(upper, start + room)
        near = [cuts.near(s, q) for s, q in zip(settings, here.q, strict=True)]
        end = None
        for _ in range(_COLLISIONS):
            apart = cuts.apart(near)
            given = [
                Given(
                    places[k],
                    np.concatenate([numbers[k], cuts.kept_apart(apart, near[k])]),
                    beside[k],
                    self.weights[k],
                )
                for k in range(len(settings))
            ]
            end = model.built(self._places, apart).solve(start, given, lower, upper)
            if not end.converged:
                return end
            there = self._evaluated(end.q)
            hits = [
                cuts.runs_into(self.setting(k, x), q)
                for k, (x, q) in enumerate(zip(there.x, there.q, strict=True))
            ]
            if not any(hits):
                return end
            near = [mine + hit for mine, hit in zip(near, hits, strict=True)]
        return None if end is None else replace(end, converged=False, status="Collision")

    def _apart(self, one: Placed, other: Placed) -> float:
        """How different two are: joints, rad or m, and free coordinates over their ranges."""
        cell = self._cases[0]
        joints = max(cell.distances(a[None], b)[0] for a, b in zip(one.q, other.q, strict=True))
        span = self._freedom.upper - self._freedom.lower
        moved = max(
            float((np.abs(a - b) / span).max(initial=0.0))
            for a, b in zip(one.x, other.x, strict=True)
        )
        return max(float(joints), moved)

    def _distinct(self, starts: Sequence[Placed], most: int) -> list[Placed]:
        def far(start: Placed, taken: Sequence[Placed]) -> bool:
            # Starts of one placement tend to end alike.
            alike = sum(other.x is start.x for other in taken)
            return alike < _OF_EACH and all(self._apart(start, x) > _UNLIKE for x in taken)

        return far_apart(starts, far, most)

    def _unlike(self, starts: Sequence[Placed], ends: Sequence[Placed]) -> list[Placed]:
        """Those of the starts that are no ends."""
        return [s for s in starts if all(self._apart(s, end) > _SAME for end in ends)]

    def _gathered(self, ends: Sequence[Placed]) -> list[Placed]:
        """Distinct ends, best first, with how many ended in each."""
        optima: list[Placed] = []
        for end in sorted(ends, key=lambda end: -end.value):
            for j, known in enumerate(optima):
                if (
                    abs(known.value - end.value) < SAME_OBJECTIVE
                    and self._apart(known, end) < _SAME
                ):
                    optima[j] = replace(known, count=known.count + 1)
                    break
            else:
                optima.append(end)
        return optima
