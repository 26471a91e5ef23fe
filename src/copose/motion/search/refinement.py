"""Refinement of a route's motion into the one that is reported, with as many knots as it takes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from copose.motion.curve.between_knots import between_bodies
from copose.motion.curve.hermite import closed_at, opening, spline_points
from copose.motion.dynamics.rates import Driven, JointRates
from copose.motion.nlp.constraint_generation import EndConditions
from copose.motion.nlp.linear_rows import longest_step
from copose.motion.nlp.motion_nlp import OptimisedMotion
from copose.motion.path.knots import Course, uniform
from copose.motion.path.object_motion import ObjectMotion
from copose.motion.search.obstruction import Obstruction, opens, program_failed
from copose.motion.search.optimiser import MotionOptimiser
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.problem import PathSpec


@dataclass(frozen=True)
class FinisherOptions:
    """Options of the refinement of a motion."""

    most_knots: int = 4000  # before the motion is given up
    twice: float = 5.0  # times the tolerance of opening beyond which knots are added twice
    free_step: float = 0.99  # part of the longest step up to which joints are not held back by it
    held_back: int = 3  # times the knots asked for that are enough where steps are held back
    least_knots: int = 25  # knots that count as asked for there, at least
    failed: int = 5  # times as many knots up to which a program that fails is tried again
    excess: float = 1.5  # part of a missing clearance that is added to the margin at knots
    leeway: float = 2e-4  # what is added besides, m
    most_margin: float = 0.5  # of the clearance, that knots keep more before there are more of them


@dataclass(frozen=True, eq=False)
class CheckedMotion:
    """A motion as it is reported, checked between its knots."""

    course: Course  # at its knots
    duration: float  # s
    q: list[Array]  # joints by arm, (n, n_i), closed
    driven: Driven  # its rates
    error: float  # the largest opening of the chain between knots, m or rad
    distance: float | None  # the smallest of bodies there, m; None where none is kept
    fine: bool  # whether it needs no more knots
    missing: float = 0.0  # how much less than the clearance bodies keep between knots, m
    value: float = np.nan  # aggregate − smoothness · S; NaN before it is accepted


@dataclass(frozen=True, eq=False)
class Refiner:
    """Refinement of motions of a cell along a path."""

    path: PathSpec  # what is asked
    journey: ObjectMotion  # the object's
    model: PostureModel  # what searches and measures postures
    shaper: MotionOptimiser  # builds and solves programs
    drive: JointRates  # computes rates and torques
    options: FinisherOptions = FinisherOptions()  # of the refinement

    def course(self, count: int) -> Course:
        """The object's path at so many knots, uniform in time."""
        return Course.of(self.model, self.journey, uniform(count))

    def closed(self, q: Array, course: Course) -> Array:
        """A motion projected onto the closed chain at every knot, as far as it can be."""
        parts = self.model.split(q)
        return np.hstack(closed_at(self.model, self.journey, parts, course.phases))

    def finished(
        self, best: OptimisedMotion, conditions: EndConditions
    ) -> CheckedMotion | Obstruction:
        """The motion with as many knots as are asked for, and as closure between them needs.

        Args:
            best: a motion with any number of knots.
            conditions: what it has to keep.
        """
        options, count, kept = self.options, self.path.knots, conditions.margin
        while True:
            course, motion = self.course(count), best
            rough = self.shaper.kinked or self.shaper.shortest
            if count != len(best.q) or rough or conditions.margin > kept:
                again = conditions.margin > kept and not self.shaper.shortest
                warm = best.multipliers if again else None
                closed = self._resampled(best, course)
                motion = self.shaper.shaped(course, closed, conditions, near=True, warm=warm)
            seen, kept = self._seen(course, motion), conditions.margin
            margin = conditions.margin + options.excess * seen.missing + options.leeway
            if motion.converged and seen.missing > 0 and margin <= self._most_margin:
                # Bodies come nearer between knots than at them: there they keep more.
                conditions, best = replace(conditions, margin=margin), motion
                continue
            if motion.converged and seen.fine:
                limited = replace(conditions, duration=motion.duration)
                before, motion = motion, self.shaper.kept(course, motion, limited)
                seen = seen if motion is before else self._seen(course, motion)
                if motion.converged and seen.fine:
                    return self._accepted(seen)
            if 2 * count - 1 > options.most_knots:
                return program_failed(motion) if not motion.converged else opens(seen.error, count)
            count = 2 * count - 1
            if motion.converged and seen.error > options.twice * self.path.tolerance:
                count = 2 * count - 1
            if motion.converged and len(motion.q) >= len(best.q):
                # Fewer knots would be a worse start than the route's own motion.
                best, conditions = motion, replace(conditions, duration=motion.duration)
            elif not motion.converged and count > options.failed * max(
                self.path.knots, len(best.q)
            ):
                return program_failed(motion)

    def _resampled(self, motion: OptimisedMotion, course: Course) -> Array:
        """A motion at other knots, (n, N), closed there."""
        return self.closed(spline_points(motion.q, course.phases), course)

    @property
    def _most_margin(self) -> float:
        """The most that bodies keep at knots beyond the clearance, m."""
        return self.options.most_margin * self.model.cell.problem.constraints.clearance

    def _accepted(self, seen: CheckedMotion) -> CheckedMotion:
        value = self.shaper.value(seen.course, np.hstack(seen.q), seen.duration)
        return replace(seen, value=value)

    def unfinished(self, best: OptimisedMotion) -> CheckedMotion | None:
        """The motion with the knots that are asked for, or some more, without another program; None
        where it does not keep everything.
        """
        for count in (self.path.knots, 2 * self.path.knots - 1):
            course = self.course(count)
            motion = replace(best, q=self._resampled(best, course))
            if self._kept_at_knots(course, motion, same=count == len(best.q)):
                seen = self._seen(course, motion)
                if seen.fine:
                    return self._accepted(seen)
        return None

    def _kept_at_knots(self, course: Course, motion: OptimisedMotion, *, same: bool) -> bool:
        """True where a motion keeps limits and clearance at knots that its program may not have
        had; ``same`` where it had.
        """
        cell = self.model.cell
        within = (motion.q >= np.concatenate(cell.lower)) & (motion.q <= np.concatenate(cell.upper))
        if not within.all() or not self.shaper.keeps_limits(course, motion):
            return False
        if same:
            return True
        postures = zip(course.settings, motion.q, strict=True)
        return not self.model.feasibility.judged and all(
            self.model.feasibility.clear(s, q[None])[0] for s, q in postures
        )

    def _seen(self, course: Course, motion: OptimisedMotion) -> CheckedMotion:
        """A motion closed at every knot and checked between them."""
        model, duration, options = self.model, motion.duration, self.options
        q = model.split(self.closed(motion.q, course))
        driven = self.drive.driven(course, q, duration)
        error = opening(model, self.journey, q, driven.velocities, duration)
        step = float(np.abs(np.diff(np.hstack(q), axis=0)).max())
        held_back = step > options.free_step * longest_step(len(course))
        enough = options.held_back * max(self.path.knots, options.least_knots)
        fine = error <= self.path.tolerance and (not held_back or len(course) > enough)
        if not fine:
            return CheckedMotion(course, duration, q, driven, error, None, fine)
        hit = between_bodies(model, self.journey, q, driven.velocities, duration)
        return CheckedMotion(
            course, duration, q, driven, error, hit.distance, hit.missing <= 0, hit.missing
        )
