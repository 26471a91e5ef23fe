"""One motion in the making: routes, programs, and what they come to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from copose.paths.answering import Answer
from copose.paths.checking import between_bodies
from copose.paths.course import Course, interpolated, uniform
from copose.paths.drive import Drive, Driven
from copose.paths.interpolation import closed_at, opening
from copose.paths.journey import Journey
from copose.paths.motion_program import longest_step
from copose.paths.obstruction import (
    Obstruction,
    blocked,
    disconnected,
    not_started,
    opens,
    program_failed,
    too_fast,
)
from copose.paths.roadmap import Roadmap
from copose.paths.routes import Finder, Route, Worth
from copose.paths.shaping import Shaped, Shaper, Wanted
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
# Routes that are optimised; they differ by more than this in some joint and layer, rad or m.
_ROUTES, _DISTANCE = 3, 0.3
# Knots at most.
_MOST_KNOTS = 4000
# By how much a motion lasts longer than the shortest, relative, and than the graph's shortest at
# first.
_LONGER, _FROM = 1e-3, 1.05
# Where the chain opens by so many times the tolerance knots are added twice.
_TWICE = 5.0
# Steps that are less than such a part of the longest that a program allows are not held back by it;
# how many times more knots are enough where they are; and are tried where a program fails.
_SHORT, _ENOUGH, _REFINED = 0.99, 3, 5
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
class Seen:
    """A motion as it is reported.

    Attributes:
        q: joints by arm, (n, n_i), closed.
        driven: its rates.
        error: the largest opening of the chain between knots, m or rad.
        distance: the smallest of bodies there, m; None where none is kept.
        fine: whether it needs no more knots.
    """

    q: list[Array]
    driven: Driven
    error: float
    distance: float | None
    fine: bool


@dataclass(frozen=True, eq=False)
class Making:
    """One motion in the making.

    Attributes:
        path: what is asked.
        journey: the object's.
        machinery: what searches and measures postures.
        shaper: builds and solves programs.
        drive: computes rates and torques.
        answer: puts results together.
        seed: of everything that is drawn.
        progress: is told.
    """

    path: PathSpec
    journey: Journey
    machinery: Machinery
    shaper: Shaper
    drive: Drive
    answer: Answer
    seed: int
    progress: Progress

    def motion(self, ends: Ends | None) -> Motion:
        """Find routes, make motions of them, and take the best."""
        layers = int(np.ceil(self.journey.fastest / _APART)) + 1
        fewest = _LAYERS if self.journey.size else _STILL_LAYERS
        course = self._course(min(max(layers, fewest), _MOST_LAYERS))
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
        if self.path.duration == "shortest":
            least = finder.least_interval() * (len(course) - 1)
            self.answer.duration = _FROM * least if 0 < least < np.inf else 1.0
            finder = self._finder(values, roadmaps, course)
        for _ in range(_SLOWER):
            routes = finder.routes(_ROUTES, _DISTANCE)
            if self.path.duration == "shortest":
                routes = [*finder.quickest(_ROUTES, _DISTANCE), *routes]
            if not routes:
                why = blocked(self.machinery, course, finder, self.answer.duration)
                record = self._record(course, roadmaps, values.combinations, [])
                return self.answer.stopped(why, record)
            tried = self._tried(course, finder, routes, held)
            if tried[0].value is None and self.path.duration != "shortest":
                # Time may be too short for all but the quickest.
                tried += self._tried(course, finder, finder.quickest(_ROUTES, _DISTANCE), held)
                tried.sort(key=lambda each: each.value is None)
            if tried[0].value is not None or self.answer.problem.path is not None:
                break
            # Nobody has said how long it may take.
            self.answer.duration *= 2
            finder = self._finder(values, roadmaps, course)
        record = self._record(course, roadmaps, values.combinations, tried)
        if tried[0].value is None:
            why = too_fast(self.machinery, finder, course, self.answer.duration)
            if why is None or self.path.duration == "shortest":
                why = program_failed(tried[0].shaped)
            return self.answer.stopped(why, record)
        return self._finished(tried[0].shaped, held, record)

    def _course(self, count: int) -> Course:
        return Course.of(self.machinery, self.journey, uniform(count))

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
        """What programs make of some routes, best first."""
        knots = self._course(len(course))
        shortest = self.path.duration == "shortest"
        solved: list[Tried] = []
        failed: list[Tried] = []
        for number, route in enumerate(routes):
            self.progress("shaping the motion", 0.5 + 0.4 * number / len(routes))
            straight = interpolated(course.phases, finder.postures(route), knots.phases)
            q = self._closed(straight, knots)
            wanted = self._wanted(held, q, self.answer.duration)
            found = self._shaped(knots, q, wanted, roughly=True)
            if not found.converged:
                failed.append(Tried(route, found, None))
                continue
            aggregate, S = self.shaper.worth(knots, found.q, found.duration)
            solved.append(Tried(route, found, aggregate - self.path.smoothness * S))
        solved.sort(key=lambda each: (shortest * each.shaped.duration, -(each.value or 0.0)))
        return [*solved, *failed]

    def _shaped(
        self,
        knots: Course,
        q: Array,
        wanted: Wanted,
        *,
        near: bool = False,
        roughly: bool = False,
    ) -> Shaped:
        if self.path.duration == "shortest":
            quick = self.shaper.shortest(knots, q, wanted)
            if not quick.converged:
                return quick
            q, wanted = quick.q, replace(wanted, duration=quick.duration * (1 + _LONGER))
        return self.shaper.shaped(knots, q, wanted, near=near, roughly=roughly)

    def _closed(self, q: Array, course: Course) -> Array:
        """A motion closed at every knot, as far as it can be."""
        parts = self.machinery.split(q)
        return np.hstack(closed_at(self.machinery, self.journey, parts, course.phases))

    def _finished(self, best: Shaped, held: Ends, record: PathSearchRecord) -> Motion:
        """With as many knots as are asked for, and as closure between them needs."""
        count, found = self.path.knots, best
        wanted = self._wanted(held, best.q, best.duration)
        longer = self.path.duration == "shortest"
        while True:
            self.progress("checking between knots", 0.95)
            course = self._course(count)
            if count != len(best.q) or self.shaper.kinked:
                straight = interpolated(uniform(len(best.q)), best.q, course.phases)
                found = self._shaped(course, self._closed(straight, course), wanted, near=True)
                wanted = replace(wanted, duration=found.duration)
            seen = self._seen(course, found)
            if found.converged and seen.fine:
                found = self.shaper.kept(course, found, wanted, longer=longer)
                seen = self._seen(course, found)
                if found.converged and seen.fine:
                    break
            if 2 * count - 1 > _MOST_KNOTS:
                why = program_failed(found) if not found.converged else opens(seen.error, count)
                return self.answer.stopped(why, record)
            count = 2 * count - 1
            if found.converged and seen.error > _TWICE * self.path.tolerance:
                count = 2 * count - 1
            if found.converged:
                best = found
            elif count > _REFINED * self.path.knots and count > _REFINED * len(best.q):
                return self.answer.stopped(program_failed(found), record)
        return self.answer.solved(
            course, self.journey, seen.q, seen.driven, seen.error, seen.distance, found.duration,
            record,
        )  # fmt: skip

    def _seen(self, course: Course, found: Shaped) -> Seen:
        """A motion as it is reported."""
        machinery, duration = self.machinery, found.duration
        q = machinery.split(self._closed(found.q, course))
        driven = self.drive.driven(course, q, duration)
        error = opening(machinery, self.journey, q, driven.velocities, duration)
        step = float(np.abs(np.diff(np.hstack(q), axis=0)).max())
        held_back = step > _SHORT * longest_step(len(course))
        fine = error <= self.path.tolerance
        fine &= not held_back or len(course) > _ENOUGH * max(self.path.knots, _LAYERS)
        if not fine:
            return Seen(q, driven, error, None, fine)
        hit = between_bodies(machinery, self.journey, q, driven.velocities, duration)
        return Seen(q, driven, error, hit.distance, not hit.too_near)

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
