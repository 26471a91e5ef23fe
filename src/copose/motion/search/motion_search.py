"""The search for a motion: roadmaps, routes through them, their programs, and the best motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from copose.cell.notes import best_so_far
from copose.motion.curve.hermite import closed_at
from copose.motion.graph.node_values import NodeValues
from copose.motion.graph.roadmap import Roadmap
from copose.motion.nlp.constraint_generation import same_motion
from copose.motion.path.knots import Course
from copose.motion.search.candidates import (
    Candidate,
    CandidateSearch,
    Ends,
    Outcome,
    TrialOptions,
)
from copose.motion.search.obstruction import Obstruction, disconnected, not_started
from copose.motion.search.preconditions import refuted
from copose.motion.search.refinement import CheckedMotion, Refiner
from copose.motion.search.result import Answer
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.posture.run.acceptance import Acceptance
from copose.posture.search.clear_samples import alone_clear
from copose.posture.search.effort import EFFORTS
from copose.posture.search.global_search import search
from copose.problem import PathSpec
from copose.progress import StoppedError, attained, sheltered, stage
from copose.results import BasinRecord, Motion, Optimum, PathSearchRecord, RouteRecord
from copose.selection import groups


@dataclass(frozen=True)
class MakingOptions:
    """Options of the search for a motion."""

    layers: int = 21  # of the graph, at least
    still_layers: int = 81  # the same where the object stays: arms go far along self-motions
    free_layers: int = 5  # the same where arms have no posture to start or to end in either
    most_layers: int = 201  # of the graph, at most
    apart: float = 0.05  # most that the object moves between two layers, m
    finer: int = 4  # times finer postures with which an arm that does not go through is followed
    little: float = 0.5  # part of an arm's postures below which bodies leave it little
    told: int = 4  # layers of which one is looked at for that
    # Times finer postures where bodies take parts of self-motions, one after the other until there
    # is a motion; where they leave little of an arm's, the last at once.
    among_bodies: tuple[int, ...] = (2, 4)
    falls: float = 0.01  # relative, by which a motion may fall behind what another route promises
    longer: float = 1.05  # times the graph's shortest duration that a motion lasts at first
    travel: float = 1.0  # that joints go which torques or accelerations limit, rad or m, about
    slower: int = 3  # longer durations tried where the object stays, each twice the one before
    begun: int = 12  # best postures at either end, where surfaces of them are known in part
    asked: int = 2  # motions known when the planner has to end that are checked


@dataclass
class _SoFar:
    """Intermediate results of a search, for a call that has to end early."""

    trial: CandidateSearch | None = None
    finished: CheckedMotion | None = None


@dataclass(frozen=True, eq=False)
class MotionSearch:
    """The search for one motion."""

    finisher: Refiner  # refines motions
    answer: Answer  # puts results together
    seed: int  # of everything that is drawn
    options: MakingOptions = MakingOptions()  # of the search
    routes: TrialOptions = field(default_factory=TrialOptions)  # of the routes that are optimised

    @property
    def path(self) -> PathSpec:
        """The path as asked."""
        return self.finisher.path

    @property
    def model(self) -> PostureModel:
        """The model that searches and measures postures."""
        return self.finisher.model

    def motion(self, ends: Ends | None) -> Motion:
        """The best motion; the best so far where the call has to end.

        Args:
            ends: postures to begin and to end with in place of the file's ``start``.
        """
        so_far = _SoFar()
        try:
            return self._motion(ends, so_far)
        except StoppedError as stop:
            with sheltered():
                return self._cut_short(so_far, stop)

    def _cut_short(self, so_far: _SoFar, stop: StoppedError) -> Motion:
        """The best motion so far.

        Raises:
            StoppedError: there is none yet.
        """
        trial, motion = so_far.trial, so_far.finished
        if trial is None:
            raise stop
        tried = Outcome.of(trial.tried, None, shortest=self.finisher.shaper.shortest).tried
        for candidate in tried[: self.options.asked]:
            motion = motion or self.finisher.unfinished(candidate.shaped)
        if motion is None:
            raise stop
        record = self._record(trial.course, trial.roadmaps, trial.values.combinations, tried)
        self.answer.notes.append(best_so_far(stop))
        return self.answer.solved(self.model, self.finisher.journey, motion, record)

    def _motion(self, ends: Ends | None, so_far: _SoFar) -> Motion:
        journey, options = self.finisher.journey, self.options
        held = self._started() if ends is None else ends
        if isinstance(held, Obstruction):
            return self.answer.stopped(held, None)
        layers = int(np.ceil(journey.fastest / options.apart)) + 1
        fewest = options.layers
        if journey.still:
            known = np.isfinite(held.first) | np.isfinite(held.last)
            fewest = options.still_layers if known.any() else options.free_layers
        course = self.finisher.course(min(max(layers, fewest), options.most_layers))
        why = refuted(self.finisher, course, held, self.answer.duration)
        if why is not None:
            return self.answer.stopped(why, None)
        fineness = options.among_bodies if self._bodies_matter else (1,)
        for finer in fineness:
            # Nobody has said how long it may take where there is no path.
            still = self.answer.problem.path is None
            slower = options.slower if finer == fineness[-1] and still else 0
            motion, record = self._searched(course, held, so_far, finer, slower)
            if isinstance(motion, CheckedMotion) or motion.status == "infeasible":
                break
        if isinstance(motion, Obstruction):
            return self.answer.stopped(motion, record)
        # The search is over: only the record is left to be made.
        with sheltered():
            return self.answer.solved(self.model, journey, motion, record)

    @property
    def _bodies_matter(self) -> bool:
        """True with bodies that an arm with one degree of freedom to spare may avoid."""
        arms = zip(self.model.arms, self.model.cell.arms, strict=True)
        spare = any(kernels.n == kernels.m + 1 and not arm.fixed for kernels, arm in arms)
        return self.model.bodies is not None and spare

    def _searched(
        self, course: Course, held: Ends, so_far: _SoFar, finer: int, slower: int
    ) -> tuple[CheckedMotion | Obstruction, PathSearchRecord]:
        """The best motion through one graph, or what stands in the way.

        Args:
            course: the graph's layers.
            held: where the motion begins and ends.
            so_far: where intermediate results are kept.
            finer: how many times nearer to each other postures are than they need be.
            slower: how many longer durations are tried.
        """
        roadmaps: list[Roadmap] = []
        why = self._follow(course, held, roadmaps, finer)
        if why is not None:
            return why, self._record(course, roadmaps, 0, [])
        stage("finding routes")
        values = NodeValues(self.model, course, roadmaps)
        trial = CandidateSearch(
            self.finisher,
            course,
            held,
            roadmaps,
            values,
            self.answer.duration,
            self.seed,
            self.routes,
        )
        if self.finisher.shaper.shortest:
            trial = trial.lasting(self._reckoned(trial.least_duration()))
        so_far.trial = trial
        outcome = trial.outcome()
        for _ in range(slower):
            if outcome.why is None or not outcome.tried:
                break
            trial = so_far.trial = trial.lasting(2 * trial.duration)
            outcome = trial.outcome()
        record = self._record(course, roadmaps, values.combinations, outcome.tried)
        if outcome.why is not None:
            return outcome.why, record
        stage("checking between knots")
        return self._finished(outcome.tried, trial, so_far), record

    def _reckoned(self, least: float) -> float:
        """The duration that is reckoned with where the shortest is sought, s; speeds alone allow
        ``least``.
        """
        forced = float(np.sqrt(self.options.travel / self.finisher.drive.briskness))
        return max(self.options.longer * least if least < np.inf else 0.0, forced) or 1.0

    def _started(self) -> Ends | Obstruction:
        """The postures that the file has the arms start in, closed there."""
        cell = self.model.cell
        first = np.full(sum(arm.n for arm in cell.arms), np.nan)
        setting = self.finisher.course(2).settings[0]
        acceptance = Acceptance(self.model, setting)
        for i, (arm, part) in enumerate(zip(cell.arms, cell.system.split(first), strict=True)):
            if arm.start is not None:
                q, notes = acceptance.start(i)
                if q is None:
                    return not_started(self.model, setting, i)
                self.answer.notes += notes
                part[:] = q
        return Ends(first, np.full(len(first), np.nan))

    def _follow(
        self, course: Course, held: Ends, roadmaps: list[Roadmap], finer: int
    ) -> Obstruction | None:
        """Make a roadmap for each arm; an obstruction where one does not go through."""
        best = self._best_first(course, held)
        for i, arm in enumerate(self.model.cell.arms):
            stage(f"following arm {arm.name}", i, len(self.model.arms))
            roadmap = self._roadmap(course, i, held, finer, best)
            coarse = roadmap.through and roadmap.spare == 1 and finer < self.options.finer
            if coarse and self._left(course, i, roadmap) < self.options.little:
                roadmap = self._roadmap(course, i, held, self.options.finer)
            roadmaps.append(roadmap)
            if roadmap.through:
                continue
            surely = partial(self._cut, course, roadmap, i, held)
            return disconnected(
                self.model, course, roadmap, i, self.answer.duration, self.seed, surely=surely
            )
        return None

    def _best_first(self, course: Course, held: Ends) -> Array | None:
        """The best postures of both ends, the last's carried back to the first, (count, N), where
        arms may begin in any and the roadmaps know surfaces of postures in part; else None.
        """
        arms = zip(self.model.arms, self.model.cell.arms, strict=True)
        surfaces = any(kernels.n > kernels.m + 1 and not arm.fixed for kernels, arm in arms)
        if not surfaces or np.isfinite(held.first).any():
            return None
        best = []
        for last in (0, len(course) - 1):
            optima = search(self.model, course.settings[last], self.seed, EFFORTS["normal"]).optima
            some = [optimum.q for optimum in optima[: self.options.begun]]
            q = self.model.split(np.reshape(some, (-1, len(held.first))))
            for phase in course.phases[:last][::-1]:
                q = closed_at(self.model, self.finisher.journey, q, np.full(len(some), phase))
            best.append(np.hstack(q))
        return np.vstack(best)

    def _left(self, course: Course, i: int, roadmap: Roadmap) -> float:
        """The part of an arm's postures that keeps clear of all but the other arms, about; 1
        without bodies.
        """
        if self.model.bodies is None:
            return 1.0
        layers = zip(
            course.settings[:: self.options.told],
            roadmap.layers[:: self.options.told],
            strict=False,
        )
        clear = [alone_clear(setting, i, layer.q) for setting, layer in layers]
        return float(np.mean(np.concatenate(clear)))

    def _cut(self, course: Course, roadmap: Roadmap, i: int, held: Ends) -> bool:
        """True where it is sure that an arm does not go through: its postures are points, or curves
        that do not go through when they are followed more finely; surfaces are known in part.
        """
        if roadmap.spare != 1:
            return roadmap.spare == 0
        fine = self.finisher.course(2 * len(course) - 1)
        return not self._roadmap(fine, i, held, self.options.finer).through

    def _roadmap(
        self, course: Course, i: int, held: Ends, finer: int, best: Array | None = None
    ) -> Roadmap:
        split, known = self.model.split, (held.first, held.last)
        start, goal = (split(q)[i] if np.isfinite(split(q)[i]).all() else None for q in known)
        return Roadmap(
            self.model, course, i, self.seed, start, goal,
            returns=self.path.closed, finer=finer, best=None if best is None else split(best)[i],
        )  # fmt: skip

    def _finished(
        self, tried: Sequence[Candidate], trial: CandidateSearch, so_far: _SoFar
    ) -> CheckedMotion | Obstruction:
        """The best motion, of the next routes too where one falls behind what theirs promise."""
        best: CheckedMotion | Obstruction | None = None
        for candidate, *_ in _distinct(tried):
            shaped = candidate.shaped
            if isinstance(best, CheckedMotion) and not self._behind(best, candidate):
                break
            motion = self.finisher.finished(shaped, trial.conditions(shaped.q, shaped.duration))
            if not isinstance(best, CheckedMotion) or self._better(motion, best):
                best = motion
            if isinstance(best, CheckedMotion):
                so_far.finished = best
                attained(best.value)
        assert best is not None
        return best

    def _behind(self, motion: CheckedMotion, other: Candidate) -> bool:
        """True where a motion is worth clearly less than another route's."""
        falls = self.options.falls
        if self.finisher.shaper.shortest:
            return motion.duration > (1 + falls) * other.shaped.duration
        assert other.value is not None
        return motion.value < other.value - falls * (1 + abs(other.value))

    def _better(self, motion: CheckedMotion | Obstruction, best: CheckedMotion) -> bool:
        if isinstance(motion, Obstruction):
            return False
        if self.finisher.shaper.shortest:
            return motion.duration < best.duration
        return motion.value > best.value

    def _record(
        self,
        course: Course,
        roadmaps: Sequence[Roadmap],
        combinations: int,
        tried: Sequence[Candidate],
    ) -> PathSearchRecord:
        arms = self.model.cell.arms
        return PathSearchRecord(
            seed=self.seed,
            layers=len(course),
            nodes={arm.name: roadmap.count for arm, roadmap in zip(arms, roadmaps, strict=False)},
            combinations=combinations,
            routes=tuple(
                RouteRecord(graph=one.route.worth, value=one.value, status=one.shaped.status)
                for one in tried
            ),
            basins=self._basins(tried),
        )

    def _basins(self, tried: Sequence[Candidate]) -> BasinRecord:
        """Counts of the routes that led to each of the motions that programs made of them."""
        optima = [
            Optimum(objective=self._worth(each[0]), count=len(each)) for each in _distinct(tried)
        ]
        return BasinRecord.of(optima, max((o.objective for o in optima), default=None))

    def _worth(self, candidate: Candidate) -> float:
        """The objective of a candidate that is a motion."""
        shortest = self.finisher.shaper.shortest
        return -candidate.shaped.duration if shortest else float(candidate.value or 0.0)


def _distinct(tried: Sequence[Candidate]) -> list[list[Candidate]]:
    """Candidates that are motions, those that are one together."""
    motions = [one for one in tried if one.value is not None]
    return groups(motions, lambda one, other: same_motion(one.shaped.q, other.shaped.q))
