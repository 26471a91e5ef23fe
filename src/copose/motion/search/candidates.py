"""Candidates: routes through one graph, each optimised to a motion, or why there is none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from copose.cell.dynamics import HELD
from copose.motion.curve.hermite import spline_points
from copose.motion.curve.straight_motion import straightened
from copose.motion.dynamics.limit_use import LimitUse, largest_strain
from copose.motion.graph.node_values import NodeValues
from copose.motion.graph.roadmap import Roadmap
from copose.motion.graph.routes import Route, RouteCost, RouteFinder
from copose.motion.nlp.constraint_generation import EndConditions, Met, same_motion
from copose.motion.nlp.motion_nlp import OptimisedMotion
from copose.motion.path.knots import Course
from copose.motion.search.obstruction import (
    Obstruction,
    blocked,
    overloaded,
    program_failed,
    too_fast,
    unheld,
)
from copose.motion.search.refinement import Refiner
from copose.poses import Array, Mask
from copose.posture.model import PostureModel
from copose.posture.search.heaviest import heaviest_object
from copose.progress import stage


@dataclass(frozen=True)
class TrialOptions:
    """Options of the optimisation of routes."""

    routes: int = 3  # that are optimised
    # The same where the graph knows less: an arm has more than one degree of freedom to spare,
    # forces are limited, or there are more than two arms.
    more_routes: int = 6
    raced: int = 3  # the same where the shortest duration is sought
    hopeless: float = 1.5  # times the least duration of such a route's beyond which none is
    distance: float = 0.3  # by which routes differ in some joint and layer, rad or m
    every: int = 64  # combinations of branches that are all judged, of arms without a choice
    even: int = 2  # routes of a kind from which motions are sought that spare torques
    easy: float = 3.0  # times the graph's shortest duration that such motions last
    calm: tuple[float, ...] = (3.0, 100.0)  # smoothness of routes that spare accelerations, and
    very_calm: float = 100.0  # of their motions, s²/rad² per unit of the objective


@dataclass(frozen=True, eq=False)
class Ends:
    """Postures of all arms in which a motion begins and ends, (N,); NaN where any serves."""

    first: Array
    last: Array


@dataclass(frozen=True, eq=False)
class Candidate:
    """A route and the motion that a program made of it."""

    route: Route  # through the graph
    shaped: OptimisedMotion
    value: float | None  # its aggregate − smoothness · S; None where the program failed
    easy: bool = False  # whether limits of torques and accelerations hold nothing back


@dataclass(frozen=True, eq=False)
class Outcome:
    """Candidates, best first, or the obstruction where none is a motion."""

    tried: list[Candidate]
    why: Obstruction | None

    @classmethod
    def of(
        cls, tried: list[Candidate], why: Obstruction | None, *, shortest: bool, alike: float = 1e-3
    ) -> Outcome:
        """Candidates in order, the shortest first if that is sought, of those that last alike, as a
        share, the best; the obstruction counts where none is a motion.
        """
        valued = [one.shaped.duration for one in tried if one.value is not None]
        enough = min(valued, default=0.0) * (1 + alike)

        def order(one: Candidate) -> tuple[bool, float, float]:
            duration = max(one.shaped.duration, enough)
            return one.value is None, shortest * duration, -(one.value or 0.0)

        ordered = sorted(tried, key=order)
        return cls(ordered, why if not ordered or ordered[0].value is None else None)


@dataclass(frozen=True, eq=False)
class CandidateSearch:
    """The search of candidates: motions of a certain duration along routes through one graph."""

    finisher: Refiner  # refines motions
    course: Course  # the graph's layers
    held: Ends  # where motions begin and end
    roadmaps: Sequence[Roadmap]  # of the arms
    values: NodeValues  # of combinations of their postures
    duration: float  # s; where the shortest is sought, the one that is reckoned with
    seed: int  # of everything that is drawn
    options: TrialOptions = TrialOptions()  # of the search
    # Motions that programs made of routes so far.
    tried: list[Candidate] = field(default_factory=list)
    _known: list[tuple[Array, Candidate]] = field(default_factory=list)
    _met: list[Met] = field(default_factory=list)

    def lasting(self, duration: float) -> CandidateSearch:
        """The same search for another duration."""
        return replace(self, duration=duration, tried=[], _known=[], _met=[])

    def least_duration(self) -> float:
        """Time that joints need at their limits of speed, s; 0 without such, ∞ without routes."""
        return self._finder.least_interval() * (len(self.course) - 1)

    @property
    def _model(self) -> PostureModel:
        return self.finisher.model

    @property
    def _limited(self) -> bool:
        """True where torques have to keep limits."""
        return self._model.cell.problem.constraints.static_torque or self._model.cell.dynamic_torque

    @cached_property
    def _finder(self) -> RouteFinder:
        return self._finder_of(self.values)

    @cached_property
    def _careful(self) -> RouteFinder:
        """The finder of routes that spare torques, where they have to keep limits."""
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
        model, options = self._model, self.options
        shortest, forceful = self.finisher.shaper.shortest, self.finisher.shaper.forceful
        simple = all(roadmap.simple for roadmap in self.roadmaps)
        sure = simple and not forceful and len(self.roadmaps) <= 2
        most = options.routes if sure else options.more_routes
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
        routes = routes or self._finder.routes(most, options.distance)
        if not routes:
            why = self._unheld() if self._limited else None
            return Outcome([], why or blocked(model, self.course, self._finder, self.duration))
        quickest = self._finder.quickest(most, options.distance) if shortest else []
        careless = shortest and self._limited and not judged
        raced = [*quickest] if careless else [*routes, *quickest]
        tried = [] if shortest else [self._made(route) for route in routes]
        best = max((one for one in tried if one.value is not None), key=_value, default=None)
        if self._limited and not judged and (best is None or not best.easy):
            few = options.routes if quickest else most
            careful = self._careful.routes(few, options.distance)
            why = self._unheld()
            if why is not None:
                return Outcome.of(tried, why, shortest=shortest)
            routes = careful or routes
            raced += routes
            tried += [] if shortest else [self._direct(route) for route in routes]
        if self.finisher.shaper.hasty and not shortest and (best is None or not best.easy):
            for calm in options.calm:
                finder = self._finder_of(self.values, calm)
                calmer = finder.routes(options.routes, options.distance)
                tried += [one for one in map(self._spared_route, calmer) if one is not None]
        if not shortest and all(one.value is None for one in tried):
            quickest = self._finder.quickest(options.routes, options.distance)
        tried += self._raced(raced) if shortest else [self._made(route) for route in quickest]
        if any(one.value is not None for one in tried):
            return Outcome.of(tried, None, shortest=shortest)
        more, why = self._spared_of(routes) if forceful else ([], self._too_fast())
        why = why or program_failed(Outcome.of(tried, None, shortest=shortest).tried[0].shaped)
        return Outcome.of(tried + more, why, shortest=shortest)

    @cached_property
    def _judged(self) -> list[tuple[LimitUse, Route]]:
        """All routes of arms whose only choice is between a few branches, with the limit that each
        strains most at the knots asked for: the best within limits first, then those that break
        them least; where the shortest is sought these alone. None without such limits.
        """
        finisher = self.finisher
        routes = self._finder.every(self.options.every) if finisher.shaper.forceful else []
        if not routes:
            return []
        course, judged = finisher.course(finisher.path.knots), []
        for route in routes:
            q = finisher.closed(self._finder.postures(route), self.course)
            q = finisher.closed(spline_points(q, course.phases), course)
            strain = largest_strain(self._model, finisher.drive, course, q, self.duration)
            judged.append((strain, route))
        enough = 0.0 if finisher.shaper.shortest else 1.0 + HELD
        return sorted(judged, key=lambda one: max(one[0].times, enough))

    def conditions(self, q: Array, duration: float) -> EndConditions:
        """End conditions of a motion, (n, N)."""
        # A joint without limits may end some turns on.
        last = np.where(np.isfinite(self.held.last), q[-1], np.nan)
        return EndConditions(duration, self.held.first, last, self.finisher.path.closed)

    @property
    def _fixed(self) -> Mask:
        """Joints that are known at the layers, (layers, N)."""
        fixed = np.zeros((len(self.course), len(self.held.first)), dtype=bool)
        fixed[0] = np.isfinite(self.held.first) | self.finisher.path.closed
        fixed[-1] = np.isfinite(self.held.last) | self.finisher.path.closed
        return fixed

    def _unheld(self) -> Obstruction | None:
        """The layer where no posture at all holds the object at rest, if that is asked."""
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
        most = heaviest_object(self.course.settings[k].cell, self.seed)
        sure = bool(self._judged)
        if not sure and len(most.q) and (self._shares(k, most.q) <= 1 + HELD).any():
            return None
        return unheld(self.course, k, self.duration, most.reason, sure=sure or most.sure)

    def _shares(self, k: int, q: Array) -> Array:
        """Largest shares of torque limits with which postures, (count, N), hold the object at rest
        at layer k, (count,); ∞ where no contact wrenches do.
        """
        capacity = self.finisher.drive.capacity
        assert capacity is not None
        holding = capacity.holding(self.course.settings[k].cell)
        shares = capacity.dynamics(holding, self._model.split(q)).shares(holding.hold)
        return np.where(np.isfinite(shares), shares, np.inf)

    def _made(self, route: Route) -> Candidate:
        """The motion of a route, by way of the best one without limits of torques and
        accelerations: routes that lead to the same of those are one.
        """
        stage("shaping the motion")
        finisher, course = self.finisher, self.course
        if not finisher.shaper.forceful:
            return self._direct(route)
        q = finisher.closed(self._finder.postures(route), course)
        conditions = self.conditions(q, self.duration)
        loose = finisher.shaper.loose(course, q, conditions)
        if not loose.converged:
            return self._direct(route)
        for other, made in self._known:
            if same_motion(loose.q, other):
                return replace(made, route=route)
        strain = largest_strain(self._model, finisher.drive, course, loose.q, loose.duration)
        shaped, easy = loose, strain.times <= 1
        if not easy:
            shaped = finisher.shaper.shaped(course, loose.q, conditions, roughly=True)
        made = replace(self._valued(route, shaped), easy=easy)
        if made.value is None:
            _, spared = self._spared(route, loose.q)
            made = made if spared is None else spared
        if made.value is None and not self._limited:
            made = self._direct(route)
        self._known.append((loose.q, made))
        return made

    def _raced(self, routes: Sequence[Route]) -> list[Candidate]:
        """The shortest motions of the routes that last the least time once they are straight."""
        finisher, course, drive = self.finisher, self.course, self.finisher.drive
        starts = []
        for route in routes:
            q = straight = finisher.closed(self._finder.postures(route), course)
            if self._model.bodies is None:
                # Bodies may be in the way of what is straight.
                straight = straightened(self._model, course, q, self._fixed)
            least = drive.least_duration(course, self._model.split(straight), self.duration)
            starts.append((least if least > 0 else np.inf, straight, q, route))
        starts.sort(key=lambda start: start[0])
        tried: list[Candidate] = []
        known: list[Array] = []
        for least, straight, q, route in starts:
            found = sum(one.value is not None for one in tried)
            hopeless = least > self.options.hopeless * starts[0][0]
            if found == self.options.raced or (found and hopeless):
                break
            if any(same_motion(straight, other) for other in known):
                continue
            stage("shaping the motion")
            known.append(straight)
            conditions = self.conditions(q, self.duration)
            motion = finisher.shaper.quickest(course, q, conditions, self._met)
            # It counts what it lasts as it is reported, by finite differences of few knots.
            motion = finisher.shaper.lengthened(course, motion)
            tried.append(self._valued(route, motion))
        return tried

    def _direct(self, route: Route) -> Candidate:
        """The motion of a route itself."""
        stage("shaping the motion")
        q = self.finisher.closed(self._finder.postures(route), self.course)
        conditions = self.conditions(q, self.duration)
        shaper = self.finisher.shaper
        shaped = shaper.shaped(self.course, q, conditions, roughly=True, met=self._met)
        return self._valued(route, shaped)

    def _valued(self, route: Route, shaped: OptimisedMotion) -> Candidate:
        if not shaped.converged:
            return Candidate(route, shaped, None)
        value = self.finisher.shaper.value(self.course, shaped.q, shaped.duration)
        tried = Candidate(route, shaped, value)
        self.tried.append(tried)
        return tried

    def _spared_of(self, routes: Sequence[Route]) -> tuple[list[Candidate], Obstruction | None]:
        """Motions by way of ones that spare torques and accelerations, or why there are none."""
        few, distance = self.options.even, self.options.distance
        even = self._careful.evenest(few, distance) if self._limited else []
        ends = [
            self._spared(route, self.finisher.closed(self._finder.postures(route), self.course))
            for route in [*even, *routes[:few]]
        ]
        motions = [tried for _, tried in ends if tried is not None]
        strains = [strain for strain, _ in ends if strain is not None]
        least = min(strains, key=lambda strain: strain.times, default=None)
        if least is None or least.times <= 1 + HELD:
            return motions, None
        return motions, overloaded(self._model, self.course, self.duration, least)

    def _spared_route(self, route: Route) -> Candidate | None:
        q = self.finisher.closed(self._finder.postures(route), self.course)
        return self._spared(route, q)[1]

    def _spared(self, route: Route, q: Array) -> tuple[LimitUse | None, Candidate | None]:
        """The limit strained most by the motion near a route's, (n, N), that spares torques and
        accelerations most, and the best motion near that where it is within the limits.
        """
        stage("sparing torques")
        finisher, course, options = self.finisher, self.course, self.options
        times = options.easy if finisher.shaper.shortest else 1.0
        conditions = self.conditions(q, self.duration * times)
        if finisher.shaper.hasty:
            calm = finisher.shaper.loose(course, q, conditions, calm=options.very_calm)
            q = calm.q if calm.converged else q
        sparing = finisher.shaper.sparing(course, q, conditions)
        if not sparing.converged or sparing.share is None:
            return None, None
        q, duration = sparing.q, sparing.duration
        strain = largest_strain(self._model, finisher.drive, course, q, duration)
        # As it is reported a motion may strain them more: finishing tightens the program for that.
        strain = replace(strain, times=sparing.share)
        if strain.times > 1 + HELD:
            return strain, None
        shaped = finisher.shaper.shaped(course, q, self.conditions(q, duration), roughly=True)
        return strain, self._valued(route, shaped)

    def _too_fast(self) -> Obstruction | None:
        """The obstruction that the shortest motions of the quickest routes last too long."""
        if self.finisher.shaper.shortest:
            return None
        shortest = [np.inf]
        for route in self._finder.quickest(self.options.routes, self.options.distance):
            q = self.finisher.closed(self._finder.postures(route), self.course)
            conditions = self.conditions(q, self.duration)
            motion = self.finisher.shaper.quickest(self.course, q, conditions)
            shortest += [motion.duration] if motion.converged else []
        least = min(shortest)
        if not self.duration < least < np.inf:
            return None
        return too_fast(self._model, self._finder, self.course, self.duration, least)


def _value(tried: Candidate) -> float:
    return -np.inf if tried.value is None else tried.value
