"""Local optimisation of motions: the best motion near a route, within limits as it is reported.

Torques and speeds of a motion as it is reported differ from its program's by finite differences:
where they break limits the program's are tightened, and it is solved again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from copose.cell.dynamics import HELD
from copose.kernels import Kernel
from copose.motion.dynamics.rates import JointRates
from copose.motion.nlp.constraint_generation import EndConditions, Met, MotionRequest, Solver
from copose.motion.nlp.knot import MotionKind
from copose.motion.nlp.motion_nlp import Multipliers, OptimisedMotion
from copose.motion.nlp.starts import values_at
from copose.motion.path.knots import Course
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.problem import PathSpec


@dataclass(frozen=True)
class ShaperOptions:
    """Options of the optimisation of a motion."""

    tightenings: int = 8  # rounds in which limits that are broken are tightened
    slacks: tuple[float, ...] = (0.02, 0.2)  # first widths of an objective's bounds, if with kinks
    excess: float = 1.5  # part of an excess by which a limit is tightened
    least_cut: float = 1e-6  # part of a limit that is cut besides
    most_cut: float = 0.5  # part of a limit that is cut for an excess at most
    longer: float = 1e-3  # part of the shortest duration by which a motion lasts longer


@dataclass(frozen=True, eq=False)
class _Used:
    """Shares of the limits that a motion uses as it is reported."""

    speeds: Array  # by joint, (N,)
    torques: Array  # by knot, (n,)
    accelerations: Array  # alike

    @property
    def within(self) -> bool:
        """True where it keeps all of them."""
        return bool(self.speeds.max() <= 1) and self.forces_within

    @property
    def forces_within(self) -> bool:
        """True where it keeps those of torques and accelerations."""
        return bool(self.accelerations.max() <= 1 and self.torques.max() <= 1 + HELD / 2)


class MotionOptimiser:
    """The optimiser of the motions of one cell.

    Attributes:
        shortest: whether the smallest duration is sought.
        speeds: limits of the joints, (N,).
        accelerations: alike.
    """

    def __init__(
        self,
        model: PostureModel,
        drive: JointRates,
        path: PathSpec,
        options: ShaperOptions = ShaperOptions(),
    ) -> None:
        """Programs are built when they are asked for."""
        self._model, self._drive, self._options = model, drive, options
        cell = model.cell
        self._worst, self._smoothness = path.aggregate == "worst", path.smoothness
        self.shortest = path.duration == "shortest"
        accelerations = [joint.acceleration for arm in cell.arms for joint in arm.joints]
        self._forced = cell.dynamic_torque or bool(np.isfinite(accelerations).any())
        # Arms without a degree to spare have no accelerations to choose, but in another time.
        free = any(
            kernels.n > kernels.m and not arm.fixed
            for kernels, arm in zip(model.arms, cell.arms, strict=True)
        )
        self.accelerations = np.array(accelerations)
        self.speeds = np.array([joint.velocity for arm in cell.arms for joint in arm.joints])
        self._solver = Solver(
            model, drive, worst=self._worst, rates=self._forced and (free or self.shortest),
            kinked=self.kinked,
        )  # fmt: skip

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """Kernels of the objective's own program and of the shortest's, which may be compiled."""
        kinds = (MotionKind.BEST, *([MotionKind.SHORTEST] if self.shortest else []))
        return tuple(kernel for kind in kinds for kernel in self._solver.task(kind).kernels)

    def smoothness(self, duration: float, calm: float = 0.0) -> float:
        """The cost of S, s²/rad² per unit of the objective, ``calm`` at least; where the shortest
        duration is sought as if it were a second, so that it does not depend on the cost.
        """
        return max(self._smoothness, calm) * (duration**2 if self.shortest else 1.0)

    def quickest(
        self, course: Course, q: Array, conditions: EndConditions, met: list[Met] | None = None
    ) -> OptimisedMotion:
        """The shortest motion near one, (n, N), which lasts ``conditions.duration``.

        Args:
            course: at the knots.
            q: to start from.
            conditions: what it has to keep.
            met: see `shaped`.
        """
        case = replace(self._case(course, conditions, met), kind=MotionKind.SHORTEST)
        return self._solver.solved(case, q)

    def loose(
        self, course: Course, q: Array, conditions: EndConditions, *, calm: float = 0.0
    ) -> OptimisedMotion:
        """The best motion near one, (n, N), without limits of torques and accelerations, and of an
        objective without kinks; at least so smooth, s²/rad² per unit of the objective.
        """
        smoothness = self.smoothness(conditions.duration, calm)
        case = self._case(course, conditions)
        case = replace(case, kind=MotionKind.UNLIMITED, smoothness=smoothness)
        return self._solver.solved(case, q)

    def sparing(self, course: Course, q: Array, conditions: EndConditions) -> OptimisedMotion:
        """A motion near one, (n, N), that keeps torque and acceleration limits, with room, or
        breaks them as little as can be.
        """
        case = replace(self._case(course, conditions), kind=MotionKind.SPARING)
        return self._solver.solved(case, q)

    def shaped(
        self,
        course: Course,
        q: Array,
        conditions: EndConditions,
        *,
        near: bool = False,
        roughly: bool = False,
        met: list[Met] | None = None,
        warm: Multipliers | None = None,
    ) -> OptimisedMotion:
        """The best motion near one, (n, N), closed at every knot; of the shortest time if that is
        sought.

        Args:
            course: at the knots.
            q: to start from.
            conditions: what it has to keep.
            near: whether it is nearly the best.
            roughly: whether an objective with kinks may be replaced by one without, and demands
                that a program leaves out may stay out.
            met: motions that ran into bodies where the same was wanted, to which others are added.
            warm: multipliers of the program that it is the answer of, where it is.
        """
        case = replace(self._case(course, conditions, met), near=near, roughly=roughly)
        return self._timed(case, q, partial(self._best, warm=warm))

    def _best(
        self, case: MotionRequest, q: Array, warm: Multipliers | None = None
    ) -> OptimisedMotion:
        if self.kinked:
            rounded = self._solver.solved(replace(case, near=False, kind=MotionKind.SMOOTHED), q)
            return rounded if case.roughly else self._sharpened(case, q, rounded)
        motion = self._solver.solved(case, q, warm)
        if case.near and not motion.converged:
            return self._solver.solved(replace(case, near=False), q)
        return motion

    def _timed(
        self, case: MotionRequest, q: Array, best: Callable[[MotionRequest, Array], OptimisedMotion]
    ) -> OptimisedMotion:
        """The best of a case near a motion, in little more than the shortest time if that is
        sought.
        """
        if not self.shortest:
            return best(case, q)
        quick = self._solver.solved(replace(case, kind=MotionKind.SHORTEST), q)
        if not quick.converged:
            return quick
        # As it is reported a motion lasts longer: that is the time that it may take.
        least = self._least(case.course, quick)
        duration = np.fmax(quick.duration * (1 + self._options.longer), least)
        conditions = replace(case.conditions, duration=float(duration))
        smoothness = self.smoothness(conditions.duration)
        motion = best(replace(case, conditions=conditions, smoothness=smoothness), quick.q)
        # So little time to spare may leave too little room for a program.
        return motion if motion.converged else quick

    @property
    def forceful(self) -> bool:
        """True where torques or accelerations have to keep limits."""
        return self._forced or self._model.cell.problem.constraints.static_torque

    @property
    def hasty(self) -> bool:
        """True where accelerations have to keep limits."""
        return bool(np.isfinite(self.accelerations).any())

    @property
    def kinked(self) -> bool:
        """True where the objective has kinks where it is largest."""
        return self._model.objective.non_smooth

    def _sharpened(
        self, case: MotionRequest, q: Array, rounded: OptimisedMotion
    ) -> OptimisedMotion:
        """The best motion of an objective with kinks, from that of one without, which stands in
        where the program with kinks does not converge.
        """
        start = rounded.q if rounded.converged else q
        for slack in self._options.slacks:
            motion = self._solver.solved(replace(case, near=False, slack=slack), start)
            if motion.converged:
                return motion
        return rounded if rounded.converged else motion

    def kept(
        self, course: Course, motion: OptimisedMotion, conditions: EndConditions
    ) -> OptimisedMotion:
        """A motion whose speeds, accelerations and torques as they are reported keep limits; where
        the shortest is sought it lasts longer for that, as little as can be.

        Args:
            course: at the knots.
            motion: what the program ended with.
            conditions: what it had to keep.
        """
        case, options = self._case(course, conditions), self._options
        known, used = motion, self._used(course, motion)
        for _ in range(options.tightenings):
            if not motion.converged or used.within or (self.shortest and used.forces_within):
                break
            case = replace(
                case,
                speeds=case.speeds if self.shortest else case.speeds * self._left(used.speeds),
                shares=case.shares * self._left(used.torques),
                calm=case.calm * self._left(used.accelerations),
            )
            motion = self._solver.solved(case, motion.q, motion.multipliers)
            used = self._used(course, motion)
        if self.shortest:
            motion = self.lengthened(course, motion if motion.converged else known)
            used = self._used(course, motion)
        if not motion.converged or used.within:
            return motion
        return replace(motion, converged=False, status="Limits_Not_Kept", violated=("", 0, 0.0))

    def lengthened(self, course: Course, motion: OptimisedMotion) -> OptimisedMotion:
        """The same motion, in the least time in which it keeps limits."""
        options = self._options
        for number in range(options.tightenings):
            least = self._least(course, motion)
            if not least > motion.duration:
                break
            beyond = 1 + options.least_cut * 10.0 ** (number // 2)
            motion = replace(motion, duration=least * beyond)
        return motion

    def _least(self, course: Course, motion: OptimisedMotion) -> float:
        """The least time in which a motion as it is reported keeps limits, s."""
        return self._drive.least_duration(course, self._model.split(motion.q), motion.duration)

    def keeps_limits(self, course: Course, motion: OptimisedMotion) -> bool:
        """True where speeds, accelerations and torques as they are reported keep limits."""
        return self._used(course, motion).within

    def _left(self, used: Array) -> Array:
        """Factors of limits of which so much is used: more is cut off than was too much."""
        options, over = self._options, np.maximum(used - 1.0, 0.0)
        cut = np.minimum(options.excess * over, options.most_cut)
        return np.asarray(np.where(over > 0, 1 - cut - options.least_cut, 1.0))

    def _case(
        self, course: Course, conditions: EndConditions, met: list[Met] | None = None
    ) -> MotionRequest:
        every = np.ones(len(course))
        return MotionRequest(
            course=course,
            conditions=conditions,
            kind=MotionKind.BEST,
            smoothness=self.smoothness(conditions.duration),
            near=False,
            slack=self._options.slacks[0],
            speeds=self.speeds,
            shares=every,
            calm=every,
            met=[] if met is None else met,
        )

    def _used(self, course: Course, motion: OptimisedMotion) -> _Used:
        driven = self._drive.driven(course, self._model.split(motion.q), motion.duration)
        accelerations = np.abs(np.hstack(driven.accelerations)) / self.accelerations
        return _Used(
            speeds=np.abs(np.hstack(driven.velocities)).max(axis=0) / self.speeds,
            torques=np.zeros(len(course)) if driven.shares is None else driven.shares.max(axis=1),
            accelerations=accelerations.max(axis=1),
        )

    def value(self, course: Course, q: Array, duration: float) -> float:
        """Aggregate − smoothness · S of a motion, (n, N)."""
        values = values_at(self._model, course, q)
        aggregate = float(values.min() if self._worst else values.mean())
        rates = np.diff(q, axis=0) * (len(q) - 1) / duration
        return aggregate - self.smoothness(duration) * float((rates**2).mean())
