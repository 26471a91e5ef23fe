"""From a route to the best motion near it: the sparse program, solved as often as it takes.

What a program leaves out joins it where its answer breaks it: pairs of bodies that it has run into,
facets of an exact set, and torques or speeds of the reported motion that differ from the program's
by its finite differences.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from copose.capability.torque_limits import Demand
from copose.paths.course import Course
from copose.paths.drive import Drive
from copose.paths.knot_task import OVER, Form, KnotTask
from copose.paths.motion_program import MotionProgram, Multipliers, Solved, Task
from copose.paths.starting import started, values_at
from copose.planning.capacity import HELD, Capacity
from copose.planning.clearance import Apart, Near, Slot
from copose.planning.limits_measures import LimitsMeasure
from copose.planning.machinery import Machinery, Setting
from copose.planning.objectives import EllipsoidMeasure
from copose.poses import Array, Mask

_EXCHANGES, _COLLISIONS, _TIGHTENINGS = 6, 10, 8
# Iterations of programs at most, and of those with kinks.
_PLAIN, _SHARP = 300, 80
# How wide the bounds of an objective with kinks start, one after the other.
_SLACKS = 0.02, 0.2
# How much more of an excess is taken away than there was, how much at least and at most.
_MORE, _LEAST, _AT_MOST = 1.5, 1e-6, 0.5
# By how much a motion lasts longer than the shortest, relative.
LONGER = 1e-3


@dataclass(frozen=True, eq=False)
class Wanted:
    """What a motion has to keep, beside the chain.

    Attributes:
        duration: s.
        first: joints at the first knot, (N,); NaN where they are free.
        last: alike at the last.
        returns: whether the last knot is the first.
    """

    duration: float
    first: Array
    last: Array
    returns: bool


@dataclass(frozen=True, eq=False)
class Shaped:
    """A motion that a program ended with.

    Attributes:
        q: joints at the knots, (n, N).
        duration: s.
        converged: whether it is an answer.
        status: in IPOPT's words.
        violated: what is broken most, at which knot, by how much.
        multipliers: of the program's answer.
    """

    q: Array
    duration: float
    converged: bool
    status: str
    violated: tuple[str, int, float]
    multipliers: Multipliers | None = None


@dataclass(frozen=True, eq=False)
class _Case:
    """A motion that is sought, and what its program leaves of the limits.

    Attributes:
        course: at the knots.
        wanted: what it has to keep.
        form: of its program.
        near: whether its program starts near its answer.
        slack: how wide the bounds of an objective with kinks start.
        speeds: of joints, (N,).
        shares: of torque limits by knot, as a part, (n,).
        calm: of acceleration limits alike.
        roughly: whether demands that the program leaves out stay out.
    """

    course: Course
    wanted: Wanted
    form: Form
    near: bool
    slack: float
    speeds: Array
    shares: Array
    calm: Array
    roughly: bool = False


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
    """Builds and solves the programs of one cell."""

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
        self._tasks: dict[tuple[Form, tuple[Slot, ...]], KnotTask] = {}
        self._numbers = self._count_numbers()

    def _count_numbers(self) -> int:
        setting = self._machinery.setting(self._machinery.cell)
        objective = setting.objective
        if isinstance(objective, LimitsMeasure) and setting.holding is not None:
            return len(
                objective.numbers(objective.demands(setting.holding)[: objective.programmed])
            )
        return len(setting.numbers)

    def task(self, form: Form | None = None, slots: tuple[Slot, ...] = ()) -> KnotTask:
        """What the programs hold at a knot; without a form those of the objective itself."""
        form = self._form() if form is None else form
        if (form, slots) not in self._tasks:
            machinery, capacity = self._machinery, self._capacity
            self._tasks[form, slots] = KnotTask(
                machinery.cell,
                machinery.objective,
                self._numbers,
                None if capacity is None else capacity.bounds,
                Apart(slots) if slots else None,
                form,
            )
        return self._tasks[form, slots]

    @property
    def _capacity(self) -> Capacity | None:
        return self._drive.capacity

    def _form(
        self, *, shortest: bool = False, rounded: bool = False, sparing: bool = False
    ) -> Form:
        return Form(self._worst, shortest, self._rates, rounded, sparing)

    def shortest(self, course: Course, q: Array, wanted: Wanted) -> Shaped:
        """The shortest motion near one, (n, N); ``wanted.duration`` is where it starts."""
        return self._exchanged(self._case(course, wanted, shortest=True), q)

    def loose(self, course: Course, q: Array, wanted: Wanted) -> Shaped:
        """The best motion near one, (n, N), without limits of torques and accelerations, and of an
        objective without kinks.
        """
        form = Form(worst=self._worst, rounded=self.kinked, loose=True)
        return self._exchanged(replace(self._case(course, wanted), form=form), q)

    def sparing(self, course: Course, q: Array, wanted: Wanted) -> Shaped:
        """A motion near one, (n, N), that keeps torque and acceleration limits, with room, or
        breaks them as little as can be.
        """
        case = replace(self._case(course, wanted), form=self._form(sparing=True))
        return self._exchanged(case, q)

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
            rounded = self._exchanged(replace(case, form=self._form(rounded=True)), q)
            return rounded if roughly else self._sharpened(case, q, rounded)
        if near:
            found = self._exchanged(replace(case, near=True), q)
            if found.converged:
                return found
        return self._exchanged(case, q)

    @property
    def forceful(self) -> bool:
        """Whether torques or accelerations have to keep limits."""
        return self._rates or self._machinery.static

    @property
    def kinked(self) -> bool:
        """Whether the objective has kinks where it is largest."""
        objective = self._machinery.objective
        return isinstance(objective, EllipsoidMeasure) and objective.kinked

    def _sharpened(self, case: _Case, q: Array, rounded: Shaped) -> Shaped:
        """From the best of the objective without kinks, which stands in where the program with
        kinks, of many knots, does not converge.
        """
        start = rounded.q if rounded.converged else q
        for slack in _SLACKS:
            found = self._exchanged(replace(case, slack=slack), start)
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

    def _again(self, case: _Case, found: Shaped, *, shortest: bool) -> Shaped:
        """The best motion of a tightened program, near the one before."""
        if not shortest:
            return self._exchanged(case, found.q, found.multipliers)
        wanted = replace(case.wanted, duration=found.duration)
        quick = self._exchanged(
            replace(case, wanted=wanted, form=self._form(shortest=True)), found.q
        )
        if not quick.converged:
            return quick
        wanted = replace(wanted, duration=quick.duration * (1 + LONGER))
        return self._exchanged(replace(case, wanted=wanted), quick.q)

    def _case(self, course: Course, wanted: Wanted, *, shortest: bool = False) -> _Case:
        every, form = np.ones(len(course)), self._form(shortest=shortest)
        return _Case(course, wanted, form, False, _SLACKS[0], self.speeds, every, every)

    def _used(self, course: Course, found: Shaped) -> _Used:
        driven = self._drive.driven(course, self._machinery.split(found.q), found.duration)
        return _Used(
            speeds=np.abs(np.hstack(driven.velocities)).max(axis=0) / self.speeds,
            torques=np.zeros(len(course)) if driven.shares is None else driven.shares.max(axis=1),
            accelerations=(np.abs(np.hstack(driven.accelerations)) / self.accelerations).max(
                axis=1
            ),
        )

    def _exchanged(self, case: _Case, q: Array, beside: Multipliers | None = None) -> Shaped:
        """With demands of an objective that a program left out."""
        machinery, demands = self._machinery, self._demands(case.course, q)
        found = self._apart(case, q, demands, beside)
        settled = case.roughly or case.form.common in ("stretch", "share")
        if demands is None or not machinery.dear or settled:
            return found
        for _ in range(_EXCHANGES):
            if not found.converged:
                break
            more = [
                machinery.tightened(setting, here[None], mine)
                for setting, here, mine in zip(case.course.settings, found.q, demands, strict=True)
            ]
            if all(each is None for each in more):
                break
            demands = [d if each is None else each for d, each in zip(demands, more, strict=True)]
            found = self._apart(case, found.q, demands, found.multipliers)
        return found

    def _demands(self, course: Course, q: Array) -> list[tuple[Demand, ...]] | None:
        if not isinstance(self._machinery.objective, LimitsMeasure):
            return None
        return [
            self._machinery.demands(setting, here[None])[0]
            for setting, here in zip(course.settings, q, strict=True)
        ]

    def _apart(
        self,
        case: _Case,
        q: Array,
        demands: list[tuple[Demand, ...]] | None,
        beside: Multipliers | None,
    ) -> Shaped:
        """With pairs of bodies that it has run into."""
        machinery, course = self._machinery, case.course
        settings = [
            machinery.calibrated(setting, here)
            for setting, here in zip(course.settings, q, strict=True)
        ]
        near = [machinery.near(s, here) for s, here in zip(settings, q, strict=True)]
        for _ in range(_COLLISIONS):
            found = self._run(case, settings, near, q, demands, beside)
            if machinery.clearance is None or not found.converged:
                return found
            hits = [machinery.runs_into(s, here) for s, here in zip(settings, found.q, strict=True)]
            if all(hit is None for hit in hits):
                return found
            near = [
                mine if hit is None else mine.joined(hit)
                for mine, hit in zip(near, hits, strict=True)
            ]
        return replace(found, converged=False, status="Collision")

    def _run(
        self,
        case: _Case,
        settings: Sequence[Setting],
        near: Sequence[Near],
        q: Array,
        demands: list[tuple[Demand, ...]] | None,
        beside: Multipliers | None,
    ) -> Shaped:
        machinery, course, wanted = self._machinery, case.course, case.wanted
        slots = machinery.slots(settings[0], near)
        task = self.task(case.form, slots)
        start = started(
            machinery, self._drive, task, course, q, wanted.duration, demands, case.slack
        )
        if not np.all(np.isfinite(start)):
            return Shaped(q, wanted.duration, False, "Singular_Start", ("", 0, np.inf))
        inertial = self._drive.inertial(course)
        parameters = np.array(
            [
                np.concatenate([
                    setting.cell.parameters,
                    self._numbers_at(setting, None if demands is None else demands[k]),
                    machinery.capsules(setting, slots, near[k]),
                    inertial[k],
                    [wanted.duration],
                ])
                for k, setting in enumerate(settings)
            ]
        )  # fmt: skip
        lower, upper = self._bounds(len(course), wanted)
        ended: Solved = MotionProgram(task, case.form).solve(
            start,
            Task(
                parameters=parameters,
                duration=wanted.duration,
                smoothness=self._smoothness,
                lower=lower,
                upper=upper,
                speeds=case.speeds,
                tightened=_parts(task, case.shares, case.calm),
                returns=wanted.returns,
                beside=beside,
                near=case.near,
                iterations=_SHARP if self.kinked and not case.form.rounded else _PLAIN,
            ),
        )
        duration = wanted.duration
        if case.form.shortest:
            duration *= float(ended.y[0, task.slices["stretch"].start])
        joints = ended.y[:, : task.joints]
        return Shaped(
            joints, duration, ended.converged, ended.status, ended.violated, ended.multipliers
        )

    def _bounds(self, count: int, wanted: Wanted) -> tuple[Array, Array]:
        cell = self._machinery.cell
        lower = np.tile(np.concatenate(cell.lower), (count, 1))
        upper = np.tile(np.concatenate(cell.upper), (count, 1))
        for k, fixed in ((0, wanted.first), (-1, wanted.last)):
            known: Mask = np.isfinite(fixed)
            lower[k, known] = upper[k, known] = fixed[known]
        if wanted.returns:
            # The first knot says it: two fixed ends and their equation are one too many.
            known = np.isfinite(wanted.first)
            lower[-1, known] = np.concatenate(cell.lower)[known] - 1.0
            upper[-1, known] = np.concatenate(cell.upper)[known] + 1.0
        return lower, upper

    def _numbers_at(self, setting: Setting, demands: Sequence[Demand] | None) -> Array:
        objective = setting.objective
        if demands is not None and isinstance(objective, LimitsMeasure):
            return objective.numbers(demands)
        return setting.numbers

    def worth(self, course: Course, q: Array, duration: float) -> tuple[float, float]:
        """The aggregate of a motion and S."""
        values = values_at(self._machinery, course, q)
        aggregate = float(values.min() if self._worst else values.mean())
        rates = np.diff(q, axis=0) * (len(q) - 1) / duration
        return aggregate, float((rates**2).mean())


def _parts(task: KnotTask, shares: Array, calm: Array) -> Array | None:
    """What is left of the bounds of torques and accelerations at every knot."""
    if np.all(shares == 1.0) and np.all(calm == 1.0):
        return None
    parts = np.ones((len(shares), len(task.bounds[0])))
    first = 0
    for constraint in task.constraints:
        rows = slice(first, first + constraint.expression.numel())
        first = rows.stop
        if constraint.name == f"torques{OVER}":
            parts[:, rows] = shares[:, None]
        elif constraint.name == f"accelerations{OVER}":
            parts[:, rows] = calm[:, None]
    return parts


def _left(excess: Array) -> Array:
    """What is left of a limit of which so much is used, as a part: more goes than was too much."""
    over = np.maximum(excess - 1.0, 0.0)
    return np.asarray(np.where(over > 0, 1 - np.minimum(_MORE * over, _AT_MOST) - _LEAST, 1.0))
