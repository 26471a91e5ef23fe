"""What programs make of routes through one graph, and what keeps them from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from copose.cell.dynamics import HELD
from copose.motion.dynamics.limit_use import LimitUse, largest_strain
from copose.motion.graph.node_values import NodeValues
from copose.motion.graph.roadmap import Roadmap
from copose.motion.graph.routes import Route, RouteCost, RouteFinder
from copose.motion.nlp.constraint_generation import EndConditions, Met, OptimisedMotion, same_motion
from copose.motion.path.knots import Course, interpolated
from copose.motion.search.obstruction import (
    Obstruction,
    blocked,
    overloaded,
    program_failed,
    too_fast,
    unheld,
)
from copose.motion.search.refinement import Refiner
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.posture.search.heaviest import heaviest
from copose.progress import stage

# Routes that are optimised, and where the graph knows less: an arm has more than one degree of
# freedom to spare, forces are limited, or there are more than two arms; they differ by more than
# this in some joint and layer, rad or m.
_ROUTES, _MORE_ROUTES, _DISTANCE = 3, 6, 0.3
# Combinations of the arms' branches that are all judged where no arm has a degree of freedom to
# spare.
_EVERY = 64
# Routes of a kind from which motions are sought that spare torques.
_EVEN = 2
# How many times longer than the graph's shortest a motion lasts that spares torques.
_EASY = 3.0
# How smooth routes are, s²/rad² per unit of the objective, whose joints are to move little, and
# motions.
_CALM, _VERY_CALM = (3.0, 100.0), 100.0


@dataclass(frozen=True, eq=False)
class Ends:
    """Joints of all arms where a motion begins and ends, (N,); NaN where any posture serves."""

    first: Array
    last: Array


@dataclass(frozen=True, eq=False)
class Candidate:
    """A route and the motion that a program made of it.

    Attributes:
        route: through the graph.
        shaped: the motion.
        value: its aggregate − smoothness · S; None where the program failed.
        easy: whether limits of torques and accelerations hold nothing back.
    """

    route: Route
    shaped: OptimisedMotion
    value: float | None
    easy: bool = False


@dataclass(frozen=True, eq=False)
class Outcome:
    """Motions of routes, best first, and why there is none where there is none."""

    tried: list[Candidate]
    why: Obstruction | None

    @classmethod
    def of(cls, tried: list[Candidate], why: Obstruction | None, *, shortest: bool) -> Outcome:
        """Put what was tried in order."""

        def order(each: Candidate) -> tuple[bool, float, float]:
            return each.value is None, shortest * each.shaped.duration, -(each.value or 0.0)

        ordered = sorted(tried, key=order)
        return cls(ordered, why if not ordered or ordered[0].value is None else None)


@dataclass(frozen=True, eq=False)
class CandidateSearch:
    """Routes through one graph in a certain time, tried.

    Attributes:
        finisher: makes motions.
        course: the graph's layers.
        held: where motions begin and end.
        roadmaps: of the arms.
        values: of combinations of their postures.
        duration: s; where the shortest is sought, the one that is reckoned with.
        seed: of everything that is drawn.
        tried: motions that programs made of routes so far.
    """

    finisher: Refiner
    course: Course
    held: Ends
    roadmaps: Sequence[Roadmap]
    values: NodeValues
    duration: float
    seed: int
    tried: list[Candidate] = field(default_factory=list)
    _known: list[tuple[Array, Candidate]] = field(default_factory=list)
    _met: list[Met] = field(default_factory=list)

    def lasting(self, duration: float) -> CandidateSearch:
        """The same in another time."""
        return replace(self, duration=duration, tried=[], _known=[], _met=[])

    def least_duration(self) -> float:
        """S that joints need at their speed limits, about; 0 without such, ∞ where no way is."""
        return self._finder.least_interval() * (len(self.course) - 1)

    @property
    def _model(self) -> PostureModel:
        return self.finisher.model

    @property
    def _limited(self) -> bool:
        """Whether torques have to keep limits."""
        return self._model.static or self._model.cell.dynamic_torque

    @cached_property
    def _finder(self) -> RouteFinder:
        return self._finder_of(self.values)

    @cached_property
    def _careful(self) -> RouteFinder:
        """Finds routes that spare torques where they are to keep limits."""
        capacity = self.finisher.drive.capacity
        if not self._limited or capacity is None:
            return self._finder
        return self._finder_of(self.values.within(capacity))

    def _finder_of(self, values: NodeValues, calm: float = 0.0) -> RouteFinder:
        path, arms = self.finisher.path, self._model.cell.arms
        worth = RouteCost(
            aggregate=path.aggregate,
            smoothness=self.finisher.shaper.smoothness(self.duration, calm),
            interval=self.duration / (len(self.course) - 1),
            speeds=tuple(np.array([joint.velocity for joint in arm.joints]) for arm in arms),
        )
        return RouteFinder(values, self.roadmaps, worth, returns=path.closed, seed=self.seed)

    def outcome(self) -> Outcome:
        """Motions of the best routes, of more where those fail or time counts."""
        model = self._model
        shortest, forceful = self.finisher.shaper.shortest, self.finisher.shaper.forceful
        simple = all(roadmap.simple for roadmap in self.roadmaps)
        sure = simple and not forceful and len(self.roadmaps) <= 2
        most = _ROUTES if sure else _MORE_ROUTES
        judged = self._judged
        if judged and (shortest or judged[0][0].what == "hold"):
            why = self._unheld()
            if why is not None:
                return Outcome([], why)
        if judged and not shortest and judged[0][0].times > 1 + HELD:
            course = self.finisher.course(self.finisher.path.knots)
            # What bodies in the way take out was not judged.
            least, count = judged[0][0], 0 if model.bodies is not None else len(judged)
            return Outcome([], overloaded(model, course, self.duration, least, judged=count))
        routes = [route for strain, route in judged if shortest or strain.times <= 1 + HELD][:most]
        routes = routes or self._finder.routes(most, _DISTANCE)
        if not routes:
            why = self._unheld() if self._limited else None
            return Outcome([], why or blocked(model, self.course, self._finder, self.duration))
        quickest = self._finder.quickest(most, _DISTANCE) if shortest else []
        careless = shortest and self._limited and not judged
        found = [] if careless else [self._made(route) for route in routes]
        best = max((each for each in found if each.value is not None), key=_value, default=None)
        if self._limited and not judged and (best is None or not best.easy):
            careful = self._careful.routes(_ROUTES if quickest else most, _DISTANCE)
            why = self._unheld()
            if why is not None:
                return Outcome.of(found, why, shortest=shortest)
            routes = careful or routes
            found += [self._direct(route) for route in routes]
        if self.finisher.shaper.hasty and not shortest and (best is None or not best.easy):
            for calm in _CALM:
                calmer = self._finder_of(self.values, calm).routes(_ROUTES, _DISTANCE)
                found += [tried for tried in map(self._spared_route, calmer) if tried is not None]
        if not shortest and all(each.value is None for each in found):
            quickest = self._finder.quickest(_ROUTES, _DISTANCE)
        found += [self._made(route) for route in quickest]
        if any(each.value is not None for each in found):
            return Outcome.of(found, None, shortest=shortest)
        more, why = self._spared_of(routes) if forceful else ([], self._too_fast())
        why = why or program_failed(Outcome.of(found, None, shortest=shortest).tried[0].shaped)
        return Outcome.of(found + more, why, shortest=shortest)

    @cached_property
    def _judged(self) -> list[tuple[LimitUse, Route]]:
        """All routes and what strains them most at the knots asked for, where torques or
        accelerations have to keep limits and arms have no choice but of a few branches: the best
        within limits first, then those that break them least. The shortest asks for the latter.
        """
        finisher = self.finisher
        routes = self._finder.every(_EVERY) if finisher.shaper.forceful else []
        if not routes:
            return []
        course, found = finisher.course(finisher.path.knots), []
        for route in routes:
            q = finisher.closed(self._finder.postures(route), self.course)
            q = finisher.closed(interpolated(self.course.phases, q, course.phases), course)
            strain = largest_strain(self._model, finisher.drive, course, q, self.duration)
            found.append((strain, route))
        enough = 0.0 if finisher.shaper.shortest else 1.0 + HELD
        return sorted(found, key=lambda each: max(each[0].times, enough))

    def wanted(self, q: Array, duration: float) -> EndConditions:
        """What a motion, (n, N), has to keep."""
        # A joint without limits may end some turns on.
        last = np.where(np.isfinite(self.held.last), q[-1], np.nan)
        return EndConditions(duration, self.held.first, last, self.finisher.path.closed)

    def _unheld(self) -> Obstruction | None:
        """Where no posture at all holds the object at rest, if that is asked."""
        held = np.flatnonzero(self._model.cell.held_knots(len(self.course)))
        if not len(held):
            return None
        shares = np.zeros(len(self.course))
        if self._judged:
            q = np.array([self._finder.postures(route) for _, route in self._judged])
            shares[held] = [self._shares(k, q[:, k]).min() for k in held.tolist()]
        else:
            shares[held] = self._careful.values.shares[held]
        k = int(shares.argmax())
        if shares[k] <= 1 + HELD:
            return None
        most = heaviest(self.course.settings[k].cell, self.seed)
        sure = bool(self._judged)
        if not sure and len(most.q) and (self._shares(k, most.q) <= 1 + HELD).any():
            return None
        return unheld(self.course, k, self.duration, most.reason, sure=sure or most.sure)

    def _shares(self, k: int, q: Array) -> Array:
        """The largest share of a limit with which postures, (count, N), hold the object at rest at
        layer k, (count,); ∞ where none of the contacts' wrenches does.
        """
        capacity = self.finisher.drive.capacity
        assert capacity is not None
        holding = capacity.holding(self.course.settings[k].cell)
        shares = capacity.dynamics(holding, self._model.split(q)).shares(holding.hold)
        return np.where(np.isfinite(shares), shares, np.inf)

    def _made(self, route: Route) -> Candidate:
        """What a program makes of a route, by way of the best motion without limits of torques and
        accelerations: routes to the same of those are one.
        """
        stage("shaping the motion")
        finisher, course = self.finisher, self.course
        if finisher.shaper.shortest or not finisher.shaper.forceful:
            return self._direct(route)
        q = finisher.closed(self._finder.postures(route), course)
        wanted = self.wanted(q, self.duration)
        loose = finisher.shaper.loose(course, q, wanted)
        if not loose.converged:
            return self._direct(route)
        for other, made in self._known:
            if same_motion(loose.q, other):
                return replace(made, route=route)
        strain = largest_strain(self._model, finisher.drive, course, loose.q, loose.duration)
        found, easy = loose, strain.times <= 1
        if not easy:
            found = finisher.shaper.shaped(course, loose.q, wanted, roughly=True)
        made = replace(self._valued(route, found), easy=easy)
        if made.value is None:
            _, spared = self._spared(route, loose.q)
            made = made if spared is None else spared
        if made.value is None and not self._limited:
            made = self._direct(route)
        self._known.append((loose.q, made))
        return made

    def _direct(self, route: Route) -> Candidate:
        """What a program makes of a route itself."""
        stage("shaping the motion")
        q = self.finisher.closed(self._finder.postures(route), self.course)
        wanted = self.wanted(q, self.duration)
        shaped = self.finisher.shaper.shaped(self.course, q, wanted, roughly=True, met=self._met)
        return self._valued(route, shaped)

    def _valued(self, route: Route, found: OptimisedMotion) -> Candidate:
        if not found.converged:
            return Candidate(route, found, None)
        tried = Candidate(route, found, self.finisher.value(self.course, found.q, found.duration))
        self.tried.append(tried)
        return tried

    def _spared_of(self, routes: Sequence[Route]) -> tuple[list[Candidate], Obstruction | None]:
        """Motions by way of some that spare torques and accelerations, and why there are none."""
        even = self._careful.evenest(_EVEN, _DISTANCE) if self._limited else []
        ends = [
            self._spared(route, self.finisher.closed(self._finder.postures(route), self.course))
            for route in [*even, *routes[:_EVEN]]
        ]
        found = [tried for _, tried in ends if tried is not None]
        strains = [strain for strain, _ in ends if strain is not None]
        least = min(strains, key=lambda strain: strain.times, default=None)
        if least is None or least.times <= 1 + HELD:
            return found, None
        return found, overloaded(self._model, self.course, self.duration, least)

    def _spared_route(self, route: Route) -> Candidate | None:
        q = self.finisher.closed(self._finder.postures(route), self.course)
        return self._spared(route, q)[1]

    def _spared(self, route: Route, q: Array) -> tuple[LimitUse | None, Candidate | None]:
        """What strains the motion near a route's, (n, N), that spares torques and accelerations
        most, and what a program makes of it where that is within the limits.
        """
        stage("sparing torques")
        finisher, course = self.finisher, self.course
        wanted = self.wanted(q, self.duration * (_EASY if finisher.shaper.shortest else 1.0))
        if finisher.shaper.hasty:
            calm = finisher.shaper.loose(course, q, wanted, calm=_VERY_CALM)
            q = calm.q if calm.converged else q
        found = finisher.shaper.sparing(course, q, wanted)
        if not found.converged or found.share is None:
            return None, None
        strain = largest_strain(self._model, finisher.drive, course, found.q, found.duration)
        # As it is reported a motion may strain them more: finishing tightens the program for that.
        strain = replace(strain, times=found.share)
        if strain.times > 1 + HELD:
            return strain, None
        wanted = self.wanted(found.q, found.duration)
        shaped = finisher.shaper.shaped(course, found.q, wanted, roughly=True)
        return strain, self._valued(route, shaped)

    def _too_fast(self) -> Obstruction | None:
        """That the shortest motions of the quickest routes last longer than is asked for."""
        if self.finisher.shaper.shortest:
            return None
        shortest = [np.inf]
        for route in self._finder.quickest(_ROUTES, _DISTANCE):
            q = self.finisher.closed(self._finder.postures(route), self.course)
            wanted = self.wanted(q, self.duration)
            found = self.finisher.shaper.quickest(self.course, q, wanted)
            shortest += [found.duration] if found.converged else []
        least = min(shortest)
        if not self.duration < least < np.inf:
            return None
        return too_fast(self._model, self._finder, self.course, self.duration, least)


def _value(tried: Candidate) -> float:
    return -np.inf if tried.value is None else tried.value
