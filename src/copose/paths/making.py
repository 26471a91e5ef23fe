"""One motion in the making: routes, what programs make of them, and the best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.paths.answering import Answer
from copose.paths.course import Course
from copose.paths.finishing import Finished, Finisher
from copose.paths.obstruction import (
    Obstruction,
    blocked,
    disconnected,
    not_started,
    program_failed,
    too_fast,
)
from copose.paths.roadmap import Roadmap
from copose.paths.routes import Finder, Route, Worth
from copose.paths.shaping import Shaped, Wanted
from copose.paths.values import Values
from copose.planning.climbing import Progress
from copose.planning.machinery import Machinery
from copose.planning.running import Run
from copose.poses import Array
from copose.problem import PathSpec
from copose.results import Motion, PathSearchRecord, RouteRecord

# Layers of the graph, at least, at least where the object stays and arms may go far along their
# self-motions, and at most; the object moves at most so far between two, m.
_LAYERS, _STILL_LAYERS, _MOST_LAYERS, _APART = 25, 81, 201, 0.05
# Routes that are optimised, and where an arm has more than one degree of freedom to spare or forces
# are limited, of which the graph knows little; they differ by more than this in some joint and
# layer, rad or m.
_ROUTES, _MORE_ROUTES, _DISTANCE = 3, 6, 0.3
# By how much a motion may fall behind what another route promises, relative.
_FALLS = 0.01
# How much longer than the graph's shortest a motion lasts at first.
_FROM = 1.05
# Durations that are tried, each twice the one before, where the object stays.
_SLOWER = 4


@dataclass(frozen=True, eq=False)
class Ends:
    """Joints of all arms where a motion begins and ends, (N,); NaN where any posture serves."""

    first: Array
    last: Array


@dataclass(frozen=True, eq=False)
class Tried:
    """A route, the motion that a program made of it, and its value, None where it failed."""

    route: Route
    shaped: Shaped
    value: float | None


@dataclass(frozen=True, eq=False)
class Making:
    """One motion in the making.

    Attributes:
        finisher: makes motions.
        answer: puts results together.
        seed: of everything that is drawn.
        progress: is told.
    """

    finisher: Finisher
    answer: Answer
    seed: int
    progress: Progress

    @property
    def path(self) -> PathSpec:
        """What is asked."""
        return self.finisher.path

    @property
    def machinery(self) -> Machinery:
        """What searches and measures postures."""
        return self.finisher.machinery

    def motion(self, ends: Ends | None) -> Motion:
        """Find routes, make motions of them, and take the best."""
        journey = self.finisher.journey
        layers = int(np.ceil(journey.fastest / _APART)) + 1
        fewest = _LAYERS if journey.size else _STILL_LAYERS
        course = self.finisher.course(min(max(layers, fewest), _MOST_LAYERS))
        held = self._started(course) if ends is None else ends
        if isinstance(held, Obstruction):
            return self.answer.stopped(held, None)
        roadmaps: list[Roadmap] = []
        why = self._follow(course, held, roadmaps)
        if why is not None:
            return self.answer.stopped(why, self._record(course, roadmaps, 0, []))
        self.progress("finding routes", 0.4)
        values = Values(self.machinery, course, roadmaps)
        finder = self._finder(values, roadmaps, course)
        if self.finisher.shortest:
            least = finder.least_interval() * (len(course) - 1)
            self.answer.duration = _FROM * least if 0 < least < np.inf else 1.0
            finder = self._finder(values, roadmaps, course)
        plain = all(roadmap.simple for roadmap in roadmaps) and not self.finisher.shaper.forceful
        most = _ROUTES if plain else _MORE_ROUTES
        for _ in range(_SLOWER):
            routes = finder.routes(most, _DISTANCE)
            if not routes:
                why = blocked(self.machinery, course, finder, self.answer.duration)
                record = self._record(course, roadmaps, values.combinations, [])
                return self.answer.stopped(why, record)
            tried = self._tried(course, finder, routes, held)
            if tried[0].value is not None or self.answer.problem.path is not None:
                break
            # Nobody has said how long it may take.
            self.answer.duration *= 2
            finder = self._finder(values, roadmaps, course)
        record = self._record(course, roadmaps, values.combinations, tried)
        if tried[0].value is None:
            # Only where speeds alone decide is the shortest motion told by them.
            told = self.finisher.shortest or self.finisher.shaper.forceful
            why = None if told else self._too_fast(course, finder, held)
            return self.answer.stopped(why or program_failed(tried[0].shaped), record)
        self.progress("checking between knots", 0.95)
        found = self._finished(tried, held)
        if isinstance(found, Obstruction):
            return self.answer.stopped(found, record)
        return self.answer.solved(journey, found, record)

    def _started(self, course: Course) -> Ends | Obstruction:
        """Where the file has the arms start, closed there."""
        cell = self.machinery.cell
        first = np.full(sum(arm.n for arm in cell.arms), np.nan)
        run = Run(self.machinery, course.settings[0], self.seed, 0.0, 0.0, self.progress)
        for i, (arm, part) in enumerate(zip(cell.arms, cell.system.split(first), strict=True)):
            if arm.start is not None:
                q = run.closed(i, arm.start, as_given=True)
                if q is None:
                    return not_started(arm.name)
                part[:] = q
        return Ends(first, np.full(len(first), np.nan))

    def _follow(self, course: Course, held: Ends, roadmaps: list[Roadmap]) -> Obstruction | None:
        """Make a roadmap for each arm; what stands in the way where one does not go through."""
        cell = self.machinery.cell
        parts = zip(cell.system.split(held.first), cell.system.split(held.last), strict=True)
        for i, both in enumerate(parts):
            self.progress(f"following arm {cell.arms[i].name}", 0.3 * i / len(cell.arms))
            start, goal = (q if np.isfinite(q).all() else None for q in both)
            roadmap = Roadmap(
                self.machinery, course, i, self.seed, start, goal, returns=self.path.closed
            )
            roadmaps.append(roadmap)
            why = disconnected(self.machinery, course, roadmap, i, self.answer.duration, self.seed)
            if why is not None:
                return why
        return None

    def _finder(self, values: Values, roadmaps: Sequence[Roadmap], course: Course) -> Finder:
        arms = self.machinery.cell.arms
        worth = Worth(
            aggregate=self.path.aggregate,
            smoothness=self.path.smoothness,
            interval=self.answer.duration / (len(course) - 1),
            speeds=tuple(np.array([joint.velocity for joint in arm.joints]) for arm in arms),
        )
        return Finder(values, roadmaps, worth, returns=self.path.closed, seed=self.seed)

    def _wanted(self, held: Ends, q: Array, duration: float) -> Wanted:
        # A joint without limits may end some turns on.
        last = np.where(np.isfinite(held.last), q[-1], np.nan)
        return Wanted(duration, held.first, last, self.path.closed)

    def _tried(
        self, course: Course, finder: Finder, routes: Sequence[Route], held: Ends
    ) -> list[Tried]:
        """What programs make of routes, best first; where time counts also of the quickest."""
        found = [self._made(course, finder, route, held) for route in routes]
        if self.finisher.shortest or all(each.value is None for each in found):
            quickest = finder.quickest(_ROUTES, _DISTANCE)
            found += [self._made(course, finder, route, held) for route in quickest]
        return sorted(found, key=self._order)

    def _order(self, tried: Tried) -> tuple[bool, float, float]:
        failed = tried.value is None
        return failed, self.finisher.shortest * tried.shaped.duration, -(tried.value or 0.0)

    def _made(self, course: Course, finder: Finder, route: Route, held: Ends) -> Tried:
        self.progress("shaping the motion", 0.7)
        q = self.finisher.closed(finder.postures(route), course)
        wanted = self._wanted(held, q, self.answer.duration)
        found = self.finisher.shaped(course, q, wanted, roughly=True)
        if not found.converged:
            return Tried(route, found, None)
        return Tried(route, found, self.finisher.value(course, found.q, found.duration))

    def _finished(self, tried: Sequence[Tried], held: Ends) -> Finished | Obstruction:
        """The best motion, of the next routes too where one falls behind what theirs promise."""
        best: Finished | Obstruction | None = None
        for each in tried:
            if each.value is None:
                break
            if isinstance(best, Finished) and not self._behind(best, each):
                break
            wanted = self._wanted(held, each.shaped.q, each.shaped.duration)
            found = self.finisher.finished(each.shaped, wanted)
            if (
                best is None
                or isinstance(best, Obstruction)
                or (isinstance(found, Finished) and self._better(found, best))
            ):
                best = found
        assert best is not None
        return best

    def _behind(self, found: Finished, other: Tried) -> bool:
        """Whether a motion is worth clearly less than another route's."""
        if self.finisher.shortest:
            return found.duration > (1 + _FALLS) * other.shaped.duration
        assert other.value is not None
        return found.value < other.value - _FALLS * (1 + abs(other.value))

    def _better(self, found: Finished, best: Finished) -> bool:
        if self.finisher.shortest:
            return found.duration < best.duration
        return found.value > best.value

    def _too_fast(self, course: Course, finder: Finder, held: Ends) -> Obstruction | None:
        """That the shortest motions of the quickest routes last longer than is asked for."""
        shortest = [np.inf]
        for route in finder.quickest(_ROUTES, _DISTANCE):
            q = self.finisher.closed(finder.postures(route), course)
            wanted = self._wanted(held, q, self.answer.duration)
            found = self.finisher.shaper.shortest(course, q, wanted)
            shortest += [found.duration] if found.converged else []
        least = min(shortest)
        if not self.answer.duration < least < np.inf:
            return None
        return too_fast(self.machinery, finder, course, self.answer.duration, least)

    def _record(
        self,
        course: Course,
        roadmaps: Sequence[Roadmap],
        combinations: int,
        tried: Sequence[Tried],
    ) -> PathSearchRecord:
        arms = self.machinery.cell.arms
        return PathSearchRecord(
            seed=self.seed,
            layers=len(course),
            nodes={arm.name: roadmap.count for arm, roadmap in zip(arms, roadmaps, strict=False)},
            combinations=combinations,
            routes=tuple(
                RouteRecord(graph=each.route.worth, value=each.value, status=each.shaped.status)
                for each in tried
            ),
        )
