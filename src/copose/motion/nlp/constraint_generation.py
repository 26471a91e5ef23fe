"""The sparse program of a motion, solved as often as it takes.

What a program leaves out joins it where its answer breaks it: pairs of bodies that it has run into,
and facets of an exact set.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from copose.collision import Witness
from copose.constraints.clearance import of_two
from copose.constraints.table import constraints_of
from copose.motion.dynamics.rates import JointRates
from copose.motion.nlp.clearance_rows import ClearanceRows
from copose.motion.nlp.knot import OVER, Form, KnotNlp
from copose.motion.nlp.motion_nlp import MotionProgram, Multipliers, Solved, Task
from copose.motion.nlp.starts import started
from copose.motion.path.knots import Course
from copose.objectives.objective import Cuts
from copose.poses import Array, Mask
from copose.posture.local.nlp_cuts import CutOptions
from copose.posture.model import PostureModel
from copose.posture.solvers.constraint_generation import GenerationOptions, Step, generate

_EXCHANGES, _COLLISIONS = 6, 10
# Joints that differ by less, rad or m, are those of one motion.
_SAME = 1e-3
# Iterations of programs at most, and of those with kinks.
_PLAIN, _SHARP = 300, 80


@dataclass(frozen=True, eq=False)
class EndConditions:
    """What a motion has to keep, beside the chain.

    Attributes:
        duration: s.
        first: joints at the first knot, (N,); NaN where they are free.
        last: alike at the last.
        returns: whether the last knot is the first.
        margin: what bodies keep at knots beyond the clearance, m.
    """

    duration: float
    first: Array
    last: Array
    returns: bool
    margin: float = 0.0


@dataclass(frozen=True, eq=False)
class OptimisedMotion:
    """A motion that a program ended with.

    Attributes:
        q: joints at the knots, (n, N).
        duration: s.
        converged: whether it is an answer.
        status: in IPOPT's words.
        violated: what is broken most, at which knot, by how much.
        multipliers: of the program's answer.
        share: of torque and acceleration limits, where as little of them as can be is sought.
    """

    q: Array
    duration: float
    converged: bool
    status: str
    violated: tuple[str, int, float]
    multipliers: Multipliers | None = None
    share: float | None = None


@dataclass(frozen=True, eq=False)
class Met:
    """A motion that runs into bodies, and what it became.

    Attributes:
        form: of its program.
        duration: that the program was given, s.
        q: joints at the knots, (n, N).
        ended: with what keeps it clear of them.
    """

    form: Form
    duration: float
    q: Array
    ended: OptimisedMotion


@dataclass(frozen=True, eq=False)
class Case:
    """A motion that is sought, and what its program leaves of the limits.

    Attributes:
        course: at the knots.
        wanted: what it has to keep.
        form: of its program.
        smoothness: s²/rad² per unit of the objective.
        near: whether its program starts near its answer.
        slack: how wide the bounds of an objective with kinks start.
        speeds: of joints, (N,).
        shares: of torque limits by knot, as a part, (n,).
        calm: of acceleration limits alike.
        roughly: whether demands that the program leaves out stay out.
        met: motions that ran into bodies where the same was wanted: what comes to one of them ends
            as it did.
    """

    course: Course
    wanted: EndConditions
    form: Form
    smoothness: float
    near: bool
    slack: float
    speeds: Array
    shares: Array
    calm: Array
    roughly: bool = False
    met: list[Met] = field(default_factory=list)


class Solver:
    """Builds and solves the programs of one cell."""

    def __init__(self, model: PostureModel, drive: JointRates, *, kinked: bool) -> None:
        """Programs are built when they are asked for.

        Args:
            model: what is built.
            drive: computes rates and wrenches.
            kinked: whether the objective has kinks where it is largest.
        """
        self._model, self._drive = model, drive
        self._kinked = kinked
        self._tasks: dict[Form, KnotNlp] = {}
        setting = model.setting(model.cell)
        self._numbers = setting.objective.program_size(setting.holding)

    def task(self, form: Form) -> KnotNlp:
        """What the programs of a form hold at a knot."""
        if form not in self._tasks:
            model, capacity = self._model, self._drive.capacity
            kept = constraints_of(model.cell, moving=True)
            self._tasks[form] = KnotNlp(
                model.cell, model.objective, self._numbers, capacity, kept, form
            )
        return self._tasks[form]

    def solved(self, case: Case, q: Array, beside: Multipliers | None = None) -> OptimisedMotion:
        """The best motion near one, (n, N), with demands that a program left out."""
        model, settings = self._model, case.course.settings
        cuts = [
            setting.objective.cuts(setting, model.split(here[None]))[0]
            for setting, here in zip(settings, q, strict=True)
        ]
        settled = case.roughly or case.form.common in ("stretch", "share")
        if not model.objective.costly or settled:
            return self._apart(case, q, cuts, beside)
        ends: list[OptimisedMotion] = []

        def solve(
            here: OptimisedMotion, cuts: list[Cuts], room: float
        ) -> Step[OptimisedMotion, list[Cuts]] | None:
            ends.append(self._apart(case, here.q, cuts, here.multipliers))
            if not ends[-1].converged:
                return None
            violated = [
                setting.objective.more_cuts(setting, model.split(q[None]), mine)
                for setting, q, mine in zip(settings, ends[-1].q, cuts, strict=True)
            ]
            added = [old if new is None else new for old, new in zip(cuts, violated, strict=True)]
            done = all(each is None for each in violated)
            return Step(ends[-1], 0.0, 0.0, None if done else added)

        start = OptimisedMotion(q, case.wanted.duration, False, "", ("", 0, np.inf), beside)
        options = GenerationOptions(rounds=1 + _EXCHANGES, free_rounds=1 + _EXCHANGES)
        generate(start, -np.inf, cuts, solve, lambda *_: True, options)
        return ends[-1]

    def _apart(
        self,
        case: Case,
        q: Array,
        cuts: list[Cuts],
        beside: Multipliers | None,
    ) -> OptimisedMotion:
        """With pairs of bodies that it has run into."""
        model, course = self._model, case.course
        near = [of_two(mine) for mine in self._witnesses(course, q, CutOptions().near)]
        met: list[Array] = []
        cold, start, multipliers = case, q, beside
        for _ in range(_COLLISIONS):
            found = self._run(case, near, q, cuts, beside)
            if not found.converged and case is not cold:
                case, q, beside = cold, start, multipliers
                continue
            if model.bodies is None or not found.converged:
                break
            hits = self._witnesses(course, found.q, case.wanted.margin)
            if not any(hits):
                break
            for known in case.met:
                same = (known.form, known.duration) == (case.form, case.wanted.duration)
                if same and same_motion(known.q, found.q):
                    return known.ended
            met.append(found.q)
            near = [(*mine, *hit) for mine, hit in zip(near, hits, strict=True)]
            if min(cut.distance for hit in hits for cut in hit) > 0:
                # What is a little too near is mended where it is.
                case, q, beside = replace(case, near=True), found.q, found.multipliers
        else:
            found = replace(found, converged=False, status="Collision")
        case.met.extend(Met(case.form, case.wanted.duration, each, found) for each in met)
        return found

    def _witnesses(self, course: Course, q: Array, beyond: float) -> list[list[Witness]]:
        """Of bodies at every knot that are less than so much farther apart than they must be."""
        bodies = self._model.bodies
        if bodies is None:
            return [[] for _ in course.settings]
        return bodies.all_witnesses(course.configurations(q), bodies.clearance + beyond)

    def _run(
        self,
        case: Case,
        near: Sequence[tuple[Witness, ...]],
        q: Array,
        cuts: list[Cuts],
        beside: Multipliers | None,
    ) -> OptimisedMotion:
        model, course, wanted = self._model, case.course, case.wanted
        task, clearance = self.task(case.form), None
        if model.bodies is not None and any(near):
            clearance = ClearanceRows(model.bodies, course, near, wanted.margin)
        start = started(model, self._drive, task, course, q, wanted.duration, cuts, case.slack)
        if not np.all(np.isfinite(start)):
            return OptimisedMotion(q, wanted.duration, False, "Singular_Start", ("", 0, np.inf))
        inertial = self._drive.inertial(course)
        parameters = np.array(
            [
                np.concatenate([
                    setting.cell.parameters,
                    setting.objective.program_numbers(setting, cuts[k]),
                    inertial[k],
                    [wanted.duration],
                ])
                for k, setting in enumerate(course.settings)
            ]
        )  # fmt: skip
        lower, upper = self._bounds(len(course), wanted)
        ended: Solved = MotionProgram(task, case.form).solve(
            start,
            Task(
                parameters=parameters,
                duration=wanted.duration,
                smoothness=case.smoothness,
                lower=lower,
                upper=upper,
                speeds=case.speeds,
                held=model.cell.held_knots(len(course)),
                clearance=clearance,
                tightened=_parts(task, case.shares, case.calm),
                returns=wanted.returns,
                beside=beside,
                near=case.near,
                iterations=_SHARP if self._kinked and not case.form.rounded else _PLAIN,
            ),
        )
        duration = wanted.duration
        if case.form.shortest:
            duration *= float(ended.y[0, task.slices["stretch"].start])
        share = float(ended.y[0, task.slices["share"].start]) if case.form.sparing else None
        return OptimisedMotion(
            q=ended.y[:, : task.joints],
            duration=duration,
            converged=ended.converged,
            status=ended.status,
            violated=ended.violated,
            multipliers=ended.multipliers,
            share=share,
        )

    def _bounds(self, count: int, wanted: EndConditions) -> tuple[Array, Array]:
        cell = self._model.cell
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


def same_motion(one: Array, other: Array) -> bool:
    """True where two motions at the same knots, (n, N), differ by nothing but rounding."""
    return bool(np.abs(one - other).max() < _SAME)


def _parts(task: KnotNlp, shares: Array, calm: Array) -> Array | None:
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
