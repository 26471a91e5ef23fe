"""From the motion of a route to the one that is reported: as many knots as it takes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from copose.motion.curve.between_knots import between_bodies
from copose.motion.curve.hermite import closed_at, opening
from copose.motion.dynamics.rates import Driven, JointRates
from copose.motion.nlp.constraint_generation import EndConditions, OptimisedMotion
from copose.motion.nlp.motion_nlp import longest_step
from copose.motion.path.knots import Course, interpolated, uniform
from copose.motion.path.object_motion import ObjectMotion
from copose.motion.search.obstruction import Obstruction, opens, program_failed
from copose.motion.search.optimiser import MotionOptimiser
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.problem import PathSpec

_MOST_KNOTS = 4000
# Where the chain opens by so many times the tolerance knots are added twice.
_TWICE = 5.0
# Steps that are less than such a part of the longest that a program allows are not held back by it;
# how many times more knots than were asked for, or than such a number, are enough where they are;
# and are tried where a program fails.
_SHORT, _ENOUGH, _FEW, _REFINED = 0.99, 3, 25, 5
# What bodies keep at knots beyond the clearance where they miss some of it between knots: so many
# times as much and this more, m; and at most, of the clearance, before there are more knots.
_MORE, _LEEWAY, _MARGIN = 1.5, 2e-4, 0.5


@dataclass(frozen=True, eq=False)
class CheckedMotion:
    """A motion as it is reported.

    Attributes:
        q: joints by arm, (n, n_i), closed.
        driven: its rates.
        error: the largest opening of the chain between knots, m or rad.
        distance: the smallest of bodies there, m; None where none is kept.
        fine: whether it needs no more knots.
        missing: how much less than the clearance bodies keep between knots, m.
    """

    q: list[Array]
    driven: Driven
    error: float
    distance: float | None
    fine: bool
    missing: float = 0.0


@dataclass(frozen=True, eq=False)
class Finished:
    """A motion that keeps everything.

    Attributes:
        course: at its knots.
        seen: itself.
        duration: s.
        value: aggregate − smoothness · S.
    """

    course: Course
    seen: CheckedMotion
    duration: float
    value: float


@dataclass(frozen=True, eq=False)
class Refiner:
    """Makes motions of a cell along a journey.

    Attributes:
        path: what is asked.
        journey: the object's.
        model: what searches and measures postures.
        shaper: builds and solves programs.
        drive: computes rates and torques.
    """

    path: PathSpec
    journey: ObjectMotion
    model: PostureModel
    shaper: MotionOptimiser
    drive: JointRates

    def course(self, count: int) -> Course:
        """The journey at so many knots, uniform in time."""
        return Course.of(self.model, self.journey, uniform(count))

    def closed(self, q: Array, course: Course) -> Array:
        """A motion closed at every knot, as far as it can be."""
        parts = self.model.split(q)
        return np.hstack(closed_at(self.model, self.journey, parts, course.phases))

    def value(self, course: Course, q: Array, duration: float) -> float:
        """Aggregate − smoothness · S of a motion, (n, N)."""
        aggregate, S = self.shaper.worth(course, q, duration)
        return aggregate - self.shaper.smoothness(duration) * S

    def finished(self, best: OptimisedMotion, wanted: EndConditions) -> Finished | Obstruction:
        """With as many knots as are asked for, and as closure between them needs.

        Args:
            best: a motion with any number of knots.
            wanted: what it has to keep.
        """
        count, kept = self.path.knots, wanted.margin
        while True:
            course, found = self.course(count), best
            if count != len(best.q) or self.shaper.kinked or wanted.margin > kept:
                straight = interpolated(uniform(len(best.q)), best.q, course.phases)
                closed = self.closed(straight, course)
                again = wanted.margin > kept and not self.shaper.shortest
                beside = best.multipliers if again else None
                found = self.shaper.shaped(course, closed, wanted, near=True, beside=beside)
            seen, kept = self._seen(course, found), wanted.margin
            margin = wanted.margin + _MORE * seen.missing + _LEEWAY
            if found.converged and seen.missing > 0 and margin <= self._most_margin:
                # Bodies come nearer between knots than at them: there they keep more.
                wanted, best = replace(wanted, margin=margin), found
                continue
            if found.converged and seen.fine:
                here = replace(wanted, duration=found.duration)
                before, found = found, self.shaper.kept(course, found, here)
                seen = seen if found is before else self._seen(course, found)
                if found.converged and seen.fine:
                    break
            if 2 * count - 1 > _MOST_KNOTS:
                return program_failed(found) if not found.converged else opens(seen.error, count)
            count = 2 * count - 1
            if found.converged and seen.error > _TWICE * self.path.tolerance:
                count = 2 * count - 1
            if found.converged and len(found.q) >= len(best.q):
                # Fewer knots would be a worse start than the route's own motion.
                best, wanted = found, replace(wanted, duration=found.duration)
            elif not found.converged and count > _REFINED * max(self.path.knots, len(best.q)):
                return program_failed(found)
        value = self.value(course, np.hstack(seen.q), found.duration)
        return Finished(course, seen, found.duration, value)

    @property
    def _most_margin(self) -> float:
        return _MARGIN * self.model.cell.problem.constraints.clearance

    def unfinished(self, best: OptimisedMotion) -> Finished | None:
        """A motion with the knots that are asked for, or some more, as it is: where it keeps
        everything without another program; else None.
        """
        for count in (self.path.knots, 2 * self.path.knots - 1):
            course = self.course(count)
            straight = interpolated(uniform(len(best.q)), best.q, course.phases)
            found = replace(best, q=self.closed(straight, course))
            if self._kept_at_knots(course, found, same=count == len(best.q)):
                seen = self._seen(course, found)
                if seen.fine:
                    value = self.value(course, np.hstack(seen.q), found.duration)
                    return Finished(course, seen, found.duration, value)
        return None

    def _kept_at_knots(self, course: Course, found: OptimisedMotion, *, same: bool) -> bool:
        """Whether a motion keeps limits and clearance at knots that its program may not have had;
        ``same`` where it had.
        """
        cell = self.model.cell
        within = (found.q >= np.concatenate(cell.lower)) & (found.q <= np.concatenate(cell.upper))
        if not within.all() or not self.shaper.keeps_limits(course, found):
            return False
        if same:
            return True
        held = zip(course.settings, found.q, strict=True)
        return not self.model.static and all(self.model.clear(s, q[None])[0] for s, q in held)

    def _seen(self, course: Course, found: OptimisedMotion) -> CheckedMotion:
        model, duration = self.model, found.duration
        q = model.split(self.closed(found.q, course))
        driven = self.drive.driven(course, q, duration)
        error = opening(model, self.journey, q, driven.velocities, duration)
        step = float(np.abs(np.diff(np.hstack(q), axis=0)).max())
        held_back = step > _SHORT * longest_step(len(course))
        fine = error <= self.path.tolerance
        fine &= not held_back or len(course) > _ENOUGH * max(self.path.knots, _FEW)
        if not fine:
            return CheckedMotion(q, driven, error, None, fine)
        hit = between_bodies(model, self.journey, q, driven.velocities, duration)
        return CheckedMotion(q, driven, error, hit.distance, hit.missing <= 0, hit.missing)
