"""From a route to the best motion near it, and from that to one that keeps limits as reported.

Torques and speeds of a motion as it is reported differ from its program's by finite differences:
where they break limits the program's tighten.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from copose.cell.dynamics import HELD
from copose.kernels import Kernel
from copose.motion.dynamics.rates import JointRates
from copose.motion.nlp.constraint_generation import (
    Case,
    EndConditions,
    Met,
    OptimisedMotion,
    Solver,
)
from copose.motion.nlp.knot import Form
from copose.motion.nlp.motion_nlp import Multipliers
from copose.motion.nlp.starts import values_at
from copose.motion.path.knots import Course
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.problem import PathSpec

_TIGHTENINGS = 8
# How wide the bounds of an objective with kinks start, one after the other.
_SLACKS = 0.02, 0.2
# How much more of an excess is taken away than there was, how much at least and at most.
_MORE, _LEAST, _AT_MOST = 1.5, 1e-6, 0.5
# By how much a motion lasts longer than the shortest, relative.
_LONGER = 1e-3


@dataclass(frozen=True, eq=False)
class _Used:
    """Parts of the limits that a motion uses as it is reported.

    Attributes:
        speeds: by joint, (N,).
        torques: by knot, (n,).
        accelerations: alike.
    """

    speeds: Array
    torques: Array
    accelerations: Array

    @property
    def within(self) -> bool:
        """Whether it keeps all of them."""
        return bool(self.speeds.max() <= 1) and self.forces_within

    @property
    def forces_within(self) -> bool:
        """Whether it keeps those of torques and accelerations."""
        return bool(self.accelerations.max() <= 1 and self.torques.max() <= 1 + HELD / 2)


class MotionOptimiser:
    """Shapes the motions of one cell.

    Attributes:
        shortest: whether the smallest duration is sought.
        speeds: limits of the joints, (N,).
        accelerations: alike.
    """

    def __init__(self, model: PostureModel, drive: JointRates, path: PathSpec) -> None:
        """Programs are built when they are asked for.

        Args:
            model: what is built.
            drive: computes rates and torques.
            path: what is asked.
        """
        self._model, self._drive = model, drive
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
        self._rates = self._forced and (free or self.shortest)
        self.accelerations = np.array(accelerations)
        self.speeds = np.array([joint.velocity for arm in cell.arms for joint in arm.joints])
        self._solver = Solver(model, drive, kinked=self.kinked)

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """What may be compiled of the objective's own program."""
        return self._solver.task(self._form()).kernels

    def _form(
        self, *, shortest: bool = False, rounded: bool = False, sparing: bool = False
    ) -> Form:
        return Form(self._worst, shortest, self._rates, rounded, sparing)

    def smoothness(self, duration: float, calm: float = 0.0) -> float:
        """What S costs of a motion, s²/rad² per unit of the objective, at least so calm; where the
        shortest is sought as if it lasted a second: how short it is does not depend on that.
        """
        return max(self._smoothness, calm) * (duration**2 if self.shortest else 1.0)

    def quickest(self, course: Course, q: Array, wanted: EndConditions) -> OptimisedMotion:
        """The shortest motion near one, (n, N); ``wanted.duration`` is where it starts."""
        return self._quickest(self._case(course, wanted), q)

    def loose(
        self, course: Course, q: Array, wanted: EndConditions, *, calm: float = 0.0
    ) -> OptimisedMotion:
        """The best motion near one, (n, N), without limits of torques and accelerations, and of an
        objective without kinks; at least so smooth, s²/rad² per unit of the objective.
        """
        form = Form(worst=self._worst, rounded=self.kinked, loose=True)
        smoothness = self.smoothness(wanted.duration, calm)
        case = replace(self._case(course, wanted), form=form, smoothness=smoothness)
        return self._solver.solved(case, q)

    def sparing(self, course: Course, q: Array, wanted: EndConditions) -> OptimisedMotion:
        """A motion near one, (n, N), that keeps torque and acceleration limits, with room, or
        breaks them as little as can be.
        """
        case = replace(self._case(course, wanted), form=self._form(sparing=True))
        return self._solver.solved(case, q)

    def shaped(
        self,
        course: Course,
        q: Array,
        wanted: EndConditions,
        *,
        near: bool = False,
        roughly: bool = False,
        met: list[Met] | None = None,
        beside: Multipliers | None = None,
    ) -> OptimisedMotion:
        """The best motion near one, (n, N), closed at every knot; of the shortest time if that is
        sought.

        Args:
            course: at the knots.
            q: to start from.
            wanted: what it has to keep.
            near: whether it is nearly the best.
            roughly: whether an objective with kinks may be replaced by one without, and demands
                that a program leaves out may stay out.
            met: motions that ran into bodies where the same was wanted, to which others are added.
            beside: multipliers of the program that it is the answer of, where it is.
        """
        case = replace(self._case(course, wanted), near=near, roughly=roughly)
        case = case if met is None else replace(case, met=met)
        return self._timed(case, q, partial(self._best, beside=beside))

    def _best(self, case: Case, q: Array, beside: Multipliers | None = None) -> OptimisedMotion:
        if self.kinked:
            rounded = self._solver.solved(
                replace(case, near=False, form=self._form(rounded=True)), q
            )
            return rounded if case.roughly else self._sharpened(case, q, rounded)
        found = self._solver.solved(case, q, beside)
        if case.near and not found.converged:
            return self._solver.solved(replace(case, near=False), q)
        return found

    def _quickest(self, case: Case, q: Array) -> OptimisedMotion:
        return self._solver.solved(replace(case, near=False, form=self._form(shortest=True)), q)

    def _timed(
        self, case: Case, q: Array, best: Callable[[Case, Array], OptimisedMotion]
    ) -> OptimisedMotion:
        """The best of a case near a motion, in little more than the shortest time if that is
        sought.
        """
        if not self.shortest:
            return best(case, q)
        quick = self._quickest(case, q)
        if not quick.converged:
            return quick
        wanted = replace(case.wanted, duration=quick.duration * (1 + _LONGER))
        smoothness = self.smoothness(wanted.duration)
        found = best(replace(case, wanted=wanted, smoothness=smoothness), quick.q)
        # So little time to spare may leave too little room for a program.
        return found if found.converged else quick

    @property
    def forceful(self) -> bool:
        """Whether torques or accelerations have to keep limits."""
        return self._forced or self._model.static

    @property
    def hasty(self) -> bool:
        """Whether accelerations have to keep limits."""
        return bool(np.isfinite(self.accelerations).any())

    @property
    def kinked(self) -> bool:
        """Whether the objective has kinks where it is largest."""
        return self._model.objective.non_smooth

    def _sharpened(self, case: Case, q: Array, rounded: OptimisedMotion) -> OptimisedMotion:
        """From the best of the objective without kinks, which stands in where the program with
        kinks, of many knots, does not converge.
        """
        start = rounded.q if rounded.converged else q
        for slack in _SLACKS:
            found = self._solver.solved(replace(case, near=False, slack=slack), start)
            if found.converged:
                return found
        return rounded if rounded.converged else found

    def kept(
        self, course: Course, found: OptimisedMotion, wanted: EndConditions
    ) -> OptimisedMotion:
        """The same where speeds, accelerations and torques as they are reported keep limits; where
        the shortest is sought it lasts longer for that, as little as can be.

        Args:
            course: at the knots.
            found: what the program ended with.
            wanted: what it had to keep.
        """
        case = self._case(course, wanted)
        for number in range(_TIGHTENINGS):
            used = self._used(course, found)
            if not found.converged or used.within:
                return found
            if self.shortest and used.forces_within:
                longer = found.duration * used.speeds.max() * (1 + _LEAST * 10.0 ** (number // 2))
                found = replace(found, duration=float(longer))
                continue
            case = replace(
                case,
                speeds=case.speeds if self.shortest else case.speeds * _left(used.speeds),
                shares=case.shares * _left(used.torques),
                calm=case.calm * _left(used.accelerations),
            )
            found = self._again(case, found)
        if self._used(course, found).within:
            return found
        return replace(found, converged=False, status="Limits_Not_Kept", violated=("", 0, 0.0))

    def keeps_limits(self, course: Course, found: OptimisedMotion) -> bool:
        """Whether speeds, accelerations and torques as they are reported keep limits."""
        return self._used(course, found).within

    def _again(self, case: Case, found: OptimisedMotion) -> OptimisedMotion:
        """The best motion of a tightened program, near the one before."""
        if not self.shortest:
            return self._solver.solved(case, found.q, found.multipliers)
        wanted = replace(case.wanted, duration=found.duration)
        return self._timed(replace(case, wanted=wanted), found.q, self._solver.solved)

    def _case(self, course: Course, wanted: EndConditions) -> Case:
        every = np.ones(len(course))
        return Case(
            course, wanted, self._form(), self.smoothness(wanted.duration), False, _SLACKS[0],
            self.speeds, every, every,
        )  # fmt: skip

    def _used(self, course: Course, found: OptimisedMotion) -> _Used:
        driven = self._drive.driven(course, self._model.split(found.q), found.duration)
        return _Used(
            speeds=np.abs(np.hstack(driven.velocities)).max(axis=0) / self.speeds,
            torques=np.zeros(len(course)) if driven.shares is None else driven.shares.max(axis=1),
            accelerations=(np.abs(np.hstack(driven.accelerations)) / self.accelerations).max(
                axis=1
            ),
        )

    def worth(self, course: Course, q: Array, duration: float) -> tuple[float, float]:
        """The aggregate of a motion and S."""
        values = values_at(self._model, course, q)
        aggregate = float(values.min() if self._worst else values.mean())
        rates = np.diff(q, axis=0) * (len(q) - 1) / duration
        return aggregate, float((rates**2).mean())


def _left(excess: Array) -> Array:
    """What is left of a limit of which so much is used, as a part: more goes than was too much."""
    over = np.maximum(excess - 1.0, 0.0)
    return np.asarray(np.where(over > 0, 1 - np.minimum(_MORE * over, _AT_MOST) - _LEAST, 1.0))
