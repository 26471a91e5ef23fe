"""From a route to the best motion near it, and from that to one that keeps limits as reported.

Torques and speeds of a motion as it is reported differ from its program's by finite differences:
where they break limits the program's tighten.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from copose.kernels import Kernel
from copose.paths.course import Course
from copose.paths.drive import Drive
from copose.paths.knot_task import Form
from copose.paths.solving import Case, Shaped, Solver, Wanted
from copose.paths.starting import values_at
from copose.planning.capacity import HELD
from copose.planning.machinery import Machinery
from copose.planning.objectives import EllipsoidMeasure
from copose.poses import Array

_TIGHTENINGS = 8
# How wide the bounds of an objective with kinks start, one after the other.
_SLACKS = 0.02, 0.2
# How much more of an excess is taken away than there was, how much at least and at most.
_MORE, _LEAST, _AT_MOST = 1.5, 1e-6, 0.5
# By how much a motion lasts longer than the shortest, relative.
LONGER = 1e-3


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


class Shaper:
    """Shapes the motions of one cell."""

    def __init__(
        self, machinery: Machinery, drive: Drive, *, worst: bool, smoothness: float
    ) -> None:
        """Programs are built when they are asked for."""
        self._machinery, self._drive = machinery, drive
        cell = machinery.cell
        self._smoothness, self._worst = smoothness, worst
        constraints = cell.problem.constraints
        accelerations = [joint.acceleration for arm in cell.arms for joint in arm.joints]
        self._rates = constraints.dynamic_torque or bool(np.isfinite(accelerations).any())
        self.accelerations = np.array(accelerations)
        self.speeds = np.array([joint.velocity for arm in cell.arms for joint in arm.joints])
        self._solver = Solver(machinery, drive, smoothness, kinked=self.kinked)

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """What may be compiled of the objective's own program."""
        return self._solver.task(self._form()).kernels

    def _form(
        self, *, shortest: bool = False, rounded: bool = False, sparing: bool = False
    ) -> Form:
        return Form(self._worst, shortest, self._rates, rounded, sparing)

    def shortest(self, course: Course, q: Array, wanted: Wanted) -> Shaped:
        """The shortest motion near one, (n, N); ``wanted.duration`` is where it starts."""
        return self._solver.solved(self._case(course, wanted, shortest=True), q)

    def loose(self, course: Course, q: Array, wanted: Wanted) -> Shaped:
        """The best motion near one, (n, N), without limits of torques and accelerations, and of an
        objective without kinks.
        """
        form = Form(worst=self._worst, rounded=self.kinked, loose=True)
        return self._solver.solved(replace(self._case(course, wanted), form=form), q)

    def sparing(self, course: Course, q: Array, wanted: Wanted) -> Shaped:
        """A motion near one, (n, N), that keeps torque and acceleration limits, with room, or
        breaks them as little as can be.
        """
        case = replace(self._case(course, wanted), form=self._form(sparing=True))
        return self._solver.solved(case, q)

    def shaped(
        self,
        course: Course,
        q: Array,
        wanted: Wanted,
        *,
        near: bool = False,
        roughly: bool = False,
    ) -> Shaped:
        """The best motion near one, (n, N), closed at every knot.

        Args:
            course: at the knots.
            q: to start from.
            wanted: what it has to keep.
            near: whether it is nearly the best.
            roughly: whether an objective with kinks may be replaced by one without, and demands
                that a program leaves out may stay out.
        """
        case = replace(self._case(course, wanted), roughly=roughly)
        if self.kinked:
            rounded = self._solver.solved(replace(case, form=self._form(rounded=True)), q)
            return rounded if roughly else self._sharpened(case, q, rounded)
        if near:
            found = self._solver.solved(replace(case, near=True), q)
            if found.converged:
                return found
        return self._solver.solved(case, q)

    @property
    def forceful(self) -> bool:
        """Whether torques or accelerations have to keep limits."""
        return self._rates or self._machinery.static

    @property
    def hasty(self) -> bool:
        """Whether accelerations have to keep limits."""
        return bool(np.isfinite(self.accelerations).any())

    @property
    def kinked(self) -> bool:
        """Whether the objective has kinks where it is largest."""
        objective = self._machinery.objective
        return isinstance(objective, EllipsoidMeasure) and objective.kinked

    def _sharpened(self, case: Case, q: Array, rounded: Shaped) -> Shaped:
        """From the best of the objective without kinks, which stands in where the program with
        kinks, of many knots, does not converge.
        """
        start = rounded.q if rounded.converged else q
        for slack in _SLACKS:
            found = self._solver.solved(replace(case, slack=slack), start)
            if found.converged:
                return found
        return rounded if rounded.converged else found

    def kept(self, course: Course, found: Shaped, wanted: Wanted, *, shortest: bool) -> Shaped:
        """The same where speeds, accelerations and torques as they are reported keep limits.

        Args:
            course: at the knots.
            found: what the program ended with.
            wanted: what it had to keep.
            shortest: whether the motion may last longer for that, as little as can be.
        """
        case = self._case(course, wanted)
        for number in range(_TIGHTENINGS):
            used = self._used(course, found)
            if not found.converged or used.within:
                return found
            if shortest and used.forces_within:
                longer = found.duration * used.speeds.max() * (1 + _LEAST * 10.0 ** (number // 2))
                found = replace(found, duration=float(longer))
                continue
            case = replace(
                case,
                speeds=case.speeds if shortest else case.speeds * _left(used.speeds),
                shares=case.shares * _left(used.torques),
                calm=case.calm * _left(used.accelerations),
            )
            found = self._again(case, found, shortest=shortest)
        if self._used(course, found).within:
            return found
        return replace(found, converged=False, status="Limits_Not_Kept", violated=("", 0, 0.0))

    def _again(self, case: Case, found: Shaped, *, shortest: bool) -> Shaped:
        """The best motion of a tightened program, near the one before."""
        if not shortest:
            return self._solver.solved(case, found.q, found.multipliers)
        wanted = replace(case.wanted, duration=found.duration)
        quick = self._solver.solved(
            replace(case, wanted=wanted, form=self._form(shortest=True)), found.q
        )
        if not quick.converged:
            return quick
        wanted = replace(wanted, duration=quick.duration * (1 + LONGER))
        best = self._solver.solved(replace(case, wanted=wanted), quick.q)
        return best if best.converged else quick

    def _case(self, course: Course, wanted: Wanted, *, shortest: bool = False) -> Case:
        every, form = np.ones(len(course)), self._form(shortest=shortest)
        return Case(course, wanted, form, False, _SLACKS[0], self.speeds, every, every)

    def _used(self, course: Course, found: Shaped) -> _Used:
        driven = self._drive.driven(course, self._machinery.split(found.q), found.duration)
        return _Used(
            speeds=np.abs(np.hstack(driven.velocities)).max(axis=0) / self.speeds,
            torques=np.zeros(len(course)) if driven.shares is None else driven.shares.max(axis=1),
            accelerations=(np.abs(np.hstack(driven.accelerations)) / self.accelerations).max(
                axis=1
            ),
        )

    def worth(self, course: Course, q: Array, duration: float) -> tuple[float, float]:
        """The aggregate of a motion and S."""
        values = values_at(self._machinery, course, q)
        aggregate = float(values.min() if self._worst else values.mean())
        rates = np.diff(q, axis=0) * (len(q) - 1) / duration
        return aggregate, float((rates**2).mean())


def _left(excess: Array) -> Array:
    """What is left of a limit of which so much is used, as a part: more goes than was too much."""
    over = np.maximum(excess - 1.0, 0.0)
    return np.asarray(np.where(over > 0, 1 - np.minimum(_MORE * over, _AT_MOST) - _LEAST, 1.0))
