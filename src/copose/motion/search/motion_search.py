"""One motion in the making: routes, what programs make of them, and the best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from copose.cell.dynamics import HELD
from copose.cell.notes import best_so_far
from copose.motion.dynamics.limit_use import holding_shares
from copose.motion.dynamics.rate_bounds import outrun
from copose.motion.graph.node_values import NodeValues
from copose.motion.graph.roadmap import Roadmap
from copose.motion.nlp.constraint_generation import same_motion
from copose.motion.path.knots import Course
from copose.motion.search.candidates import Candidate, CandidateSearch, Ends, Outcome
from copose.motion.search.obstruction import (
    Obstruction,
    disconnected,
    dropped,
    not_started,
    outpaced,
    uncarried,
)
from copose.motion.search.refinement import Finished, Refiner
from copose.motion.search.result import Answer
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.posture.run.run import Run
from copose.posture.search.clear_samples import alone_clear
from copose.problem import PathSpec
from copose.progress import StoppedError, attained, sheltered, stage
from copose.results import Motion, PathSearchRecord, RouteRecord

# Layers of the graph, at least.
_LAYERS = 25
# The same where the object stays and arms may go far along their self-motions.
_STILL_LAYERS = 81
# The same where the object stays and arms have no posture to start or end in either.
_FREE_LAYERS = 5
# Layers of the graph, at most.
_MOST_LAYERS = 201
# How far the object moves between two layers, at most, m.
_APART = 0.05
# How many times finer postures are looked at again where an arm does not go through.
_FINER = 4
# Share of an arm's postures below which bodies leave it little.
_LITTLE = 0.5
# Every so many layers are looked at for that.
_TOLD = 4
# The same where bodies in the way take parts of self-motions, one after the other until there is a
# motion; where they leave little of an arm's, the last at once.
_AMONG_BODIES = (2, 4)
# By how much a motion may fall behind what another route promises, relative.
_FALLS = 0.01
# How much longer than the graph's shortest a motion lasts at first, and how far joints go that
# torques or accelerations limit, rad or m, about.
_FROM, _TRAVEL = 1.05, 1.0
# Longer durations that are tried, each twice the one before, where the object stays.
_SLOWER = 3
# Of the motions known when the planner has to end, so many are asked whether they are an answer.
_ASKED = 2


@dataclass
class _SoFar:
    """What a motion in the making has come to."""

    course: Course | None = None
    roadmaps: list[Roadmap] = field(default_factory=list)
    combinations: int = 0
    trial: CandidateSearch | None = None
    finished: Finished | None = None


@dataclass(frozen=True, eq=False)
class MotionSearch:
    """One motion in the making.

    Attributes:
        finisher: makes motions.
        answer: puts results together.
        seed: of everything that is drawn.
    """

    finisher: Refiner
    answer: Answer
    seed: int

    @property
    def path(self) -> PathSpec:
        """What is asked."""
        return self.finisher.path

    @property
    def model(self) -> PostureModel:
        """What searches and measures postures."""
        return self.finisher.model

    def motion(self, ends: Ends | None) -> Motion:
        """Find routes, make motions of them, and take the best; the best so far where the call has
        to end.
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
        trial, found = so_far.trial, so_far.finished
        if trial is None or so_far.course is None:
            raise stop
        tried = Outcome.of(trial.tried, None, shortest=self.finisher.shaper.shortest).tried
        for each in tried[:_ASKED]:
            found = found or self.finisher.unfinished(each.shaped)
        if found is None:
            raise stop
        record = self._record(so_far.course, so_far.roadmaps, so_far.combinations, tried)
        self.answer.notes.append(best_so_far(stop))
        return self.answer.solved(self.model, self.finisher.journey, found, record)

    def _motion(self, ends: Ends | None, so_far: _SoFar) -> Motion:
        journey = self.finisher.journey
        held = self._started() if ends is None else ends
        if isinstance(held, Obstruction):
            return self.answer.stopped(held, None)
        layers = int(np.ceil(journey.fastest / _APART)) + 1
        fewest = _LAYERS
        if journey.still:
            known = np.isfinite(held.first) | np.isfinite(held.last)
            fewest = _STILL_LAYERS if known.any() else _FREE_LAYERS
        course = self.finisher.course(min(max(layers, fewest), _MOST_LAYERS))
        why = self._uncarried(course) or self._dropped(course, held) or self._outpaced(course)
        if why is not None:
            return self.answer.stopped(why, None)
        so_far.course = course
        fineness = _AMONG_BODIES if self._bodies_matter else (1,)
        for finer in fineness:
            # Nobody has said how long it may take where there is no path.
            slower = _SLOWER if finer == fineness[-1] and self.answer.problem.path is None else 0
            found, record = self._searched(course, held, so_far, finer, slower)
            if isinstance(found, Finished) or found.status == "infeasible":
                break
        if isinstance(found, Obstruction):
            return self.answer.stopped(found, record)
        # All is found: only the record is left to be made.
        with sheltered():
            return self.answer.solved(self.model, journey, found, record)

    @property
    def _bodies_matter(self) -> bool:
        """True with bodies that an arm with one degree of freedom to spare may avoid."""
        arms = zip(self.model.arms, self.model.cell.arms, strict=True)
        spare = any(kernels.n == kernels.m + 1 and not arm.fixed for kernels, arm in arms)
        return self.model.bodies is not None and spare

    def _searched(
        self, course: Course, held: Ends, so_far: _SoFar, finer: int, slower: int
    ) -> tuple[Finished | Obstruction, PathSearchRecord]:
        """The best motion through a graph so fine, or what stands in the way, in as many longer
        durations too.
        """
        so_far.roadmaps = []
        roadmaps = so_far.roadmaps
        why = self._follow(course, held, roadmaps, finer)
        if why is not None:
            return why, self._record(course, roadmaps, 0, [])
        stage("finding routes")
        values = NodeValues(self.model, course, roadmaps)
        trial = CandidateSearch(
            self.finisher, course, held, roadmaps, values, self.answer.duration, self.seed
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
        so_far.combinations = values.combinations
        record = self._record(course, roadmaps, values.combinations, outcome.tried)
        if outcome.why is not None:
            return outcome.why, record
        stage("checking between knots")
        return self._finished(outcome.tried, trial, so_far), record

    def _reckoned(self, least: float) -> float:
        """S that the shortest motion is reckoned to last, which speeds alone allow in so many."""
        forced = float(np.sqrt(_TRAVEL / self.finisher.drive.briskness))
        return max(_FROM * least if least < np.inf else 0.0, forced) or 1.0

    def _uncarried(self, course: Course) -> Obstruction | None:
        """Where torques have to keep limits and no contact wrenches carry the object at all."""
        moving = self.model.cell.dynamic_torque
        if not (self.model.static or moving):
            return None
        k = self.finisher.drive.torques.uncarried(course, moving=moving)
        if k is None:
            return None
        return uncarried(self.model, course, k, self.answer.duration)

    def _outpaced(self, course: Course) -> Obstruction | None:
        """Where a grasp moves faster than its arm can follow, in the time that is asked for."""
        duration = self.path.duration
        if isinstance(duration, str):
            return None
        # Differences between knots do not see what rates do there.
        step = duration / (self.path.knots - 1)
        found = outrun(self.model.cell, course, duration, step)
        return None if found is None else outpaced(self.model, course, duration, found)

    def _dropped(self, course: Course, held: Ends) -> Obstruction | None:
        """Where the posture that the motion has to begin or to end in does not hold the object."""
        model, capacity = self.model, self.finisher.drive.capacity
        for k, q in ((0, held.first), (len(course) - 1, held.last)):
            if not model.cell.held_knots(len(course))[k] or not np.isfinite(q).all():
                continue
            assert capacity is not None
            shares = holding_shares(model, capacity, course, k, q)
            if shares.max() > 1 + HELD:
                return dropped(model, course, k, shares)
        return None

    def _started(self) -> Ends | Obstruction:
        """Where the file has the arms start, closed there."""
        cell = self.model.cell
        first = np.full(sum(arm.n for arm in cell.arms), np.nan)
        setting = self.finisher.course(2).settings[0]
        run = Run(self.model, setting, self.seed, 0.0, 0.0)
        for i, (arm, part) in enumerate(zip(cell.arms, cell.system.split(first), strict=True)):
            if arm.start is not None:
                q, notes = run.start(i)
                if q is None:
                    return not_started(self.model, setting, i)
                self.answer.notes += notes
                part[:] = q
        return Ends(first, np.full(len(first), np.nan))

    def _follow(
        self, course: Course, held: Ends, roadmaps: list[Roadmap], finer: int
    ) -> Obstruction | None:
        """Make a roadmap for each arm; what stands in the way where one does not go through."""
        cell = self.model.cell
        parts = zip(cell.system.split(held.first), cell.system.split(held.last), strict=True)
        for i, both in enumerate(parts):
            stage(f"following arm {cell.arms[i].name}", i, len(cell.arms))
            start, goal = (q if np.isfinite(q).all() else None for q in both)
            roadmap = self._roadmap(course, i, start, goal, finer)
            coarse = roadmap.through and roadmap.spare == 1 and finer < _FINER
            if coarse and self._left(course, i, roadmap) < _LITTLE:
                roadmap = self._roadmap(course, i, start, goal, _FINER)
            roadmaps.append(roadmap)
            if roadmap.through:
                continue
            surely = partial(self._cut, course, roadmap, i, start, goal)
            return disconnected(
                self.model, course, roadmap, i, self.answer.duration, self.seed, surely=surely
            )
        return None

    def _left(self, course: Course, i: int, roadmap: Roadmap) -> float:
        """What part of an arm's postures keeps clear of all but the other arms, about; 1 without
        bodies.
        """
        if self.model.bodies is None:
            return 1.0
        layers = zip(course.settings[::_TOLD], roadmap.layers[::_TOLD], strict=False)
        clear = [alone_clear(setting, i, layer.q) for setting, layer in layers]
        return float(np.mean(np.concatenate(clear)))

    def _cut(
        self, course: Course, roadmap: Roadmap, i: int, start: Array | None, goal: Array | None
    ) -> bool:
        """Whether an arm that does not go through has points for postures, or curves that do not go
        through when they are followed again, more finely; surfaces are known in part.
        """
        if roadmap.spare != 1:
            return roadmap.spare == 0
        fine = self.finisher.course(2 * len(course) - 1)
        return not self._roadmap(fine, i, start, goal, _FINER).through

    def _roadmap(
        self, course: Course, i: int, start: Array | None, goal: Array | None, finer: int
    ) -> Roadmap:
        return Roadmap(
            self.model, course, i, self.seed, start, goal, returns=self.path.closed, finer=finer
        )

    def _finished(
        self, tried: Sequence[Candidate], trial: CandidateSearch, so_far: _SoFar
    ) -> Finished | Obstruction:
        """The best motion, of the next routes too where one falls behind what theirs promise."""
        best: Finished | Obstruction | None = None
        known: list[Array] = []
        for each in tried:
            if each.value is None:
                break
            if any(same_motion(each.shaped.q, q) for q in known):
                continue
            known.append(each.shaped.q)
            if isinstance(best, Finished) and not self._behind(best, each):
                break
            wanted = trial.wanted(each.shaped.q, each.shaped.duration)
            found = self.finisher.finished(each.shaped, wanted)
            if (
                best is None
                or isinstance(best, Obstruction)
                or (isinstance(found, Finished) and self._better(found, best))
            ):
                best = found
            if isinstance(best, Finished):
                so_far.finished = best
                attained(best.value)
        assert best is not None
        return best

    def _behind(self, found: Finished, other: Candidate) -> bool:
        """Whether a motion is worth clearly less than another route's."""
        if self.finisher.shaper.shortest:
            return found.duration > (1 + _FALLS) * other.shaped.duration
        assert other.value is not None
        return found.value < other.value - _FALLS * (1 + abs(other.value))

    def _better(self, found: Finished, best: Finished) -> bool:
        if self.finisher.shaper.shortest:
            return found.duration < best.duration
        return found.value > best.value

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
                RouteRecord(graph=each.route.worth, value=each.value, status=each.shaped.status)
                for each in tried
            ),
        )
