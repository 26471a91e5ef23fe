"""Constraint generation for a motion: its sparse program is solved, and again with what it broke.

What joins are pairs of bodies that the answer ran into, and facets of an exact set.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from copose.collision import Witness
from copose.constraints.clearance import of_two
from copose.constraints.registry import constraints_of
from copose.motion.dynamics.rates import JointRates
from copose.motion.nlp.clearance_rows import ClearanceRows
from copose.motion.nlp.knot import KnotNlp, MotionKind
from copose.motion.nlp.knot_constraints import tightened
from copose.motion.nlp.motion_nlp import MotionInputs, MotionProgram, Multipliers, OptimisedMotion
from copose.motion.nlp.starts import started
from copose.motion.path.knots import Course
from copose.objectives.objective import Cuts
from copose.poses import Array, Mask
from copose.posture.local.nlp_cuts import CutOptions
from copose.posture.model import PostureModel
from copose.posture.solvers.constraint_generation import GenerationOptions, ProgramEnd, generate


@dataclass(frozen=True)
class SolverOptions:
    """Options of the rounds in which a program is solved, and of IPOPT."""

    exchanges: int = 6  # rounds in which demands that were left out join
    collisions: int = 10  # rounds in which pairs of bodies that are met join
    iterations: int = 300  # of IPOPT at most
    kinked_iterations: int = 80  # the same of an objective with kinks


@dataclass(frozen=True, eq=False)
class EndConditions:
    """End conditions, duration and margin of a motion."""

    duration: float  # s
    first: Array  # joints at the first knot, (N,); NaN where they are free
    last: Array  # alike at the last
    returns: bool  # whether the last knot is the first
    margin: float = 0.0  # what bodies keep at knots beyond the clearance, m


@dataclass(frozen=True, eq=False)
class Met:
    """A motion that ran into bodies, and what it became once they had joined its program."""

    kind: MotionKind  # of its program
    duration: float  # that the program was given, s
    q: Array  # joints at the knots, (n, N)
    ended: OptimisedMotion  # with what keeps it clear of them


@dataclass(frozen=True, eq=False)
class MotionRequest:
    """A motion that is sought, and the factors by which its program tightens limits."""

    course: Course  # at the knots
    conditions: EndConditions  # what it has to keep
    kind: MotionKind  # of its program
    smoothness: float  # s²/rad² per unit of the objective
    near: bool  # whether its program starts near its answer
    slack: float  # how wide the bounds of an objective with kinks start
    speeds: Array  # of joints, (N,)
    shares: Array  # factors of torque limits by knot, (n,)
    calm: Array  # factors of acceleration limits alike
    # Motions that ran into bodies where the same was wanted: what comes to one of them ends as it
    # did.
    met: list[Met]
    roughly: bool = False  # whether demands that the program leaves out stay out


class Solver:
    """The programs of one cell, built when they are asked for, and their solution."""

    def __init__(
        self,
        model: PostureModel,
        drive: JointRates,
        *,
        worst: bool,
        rates: bool,
        kinked: bool,
        options: SolverOptions = SolverOptions(),
    ) -> None:
        """Set up the solver.

        Args:
            model: what is built.
            drive: computes rates and wrenches.
            worst: whether the least objective of all knots counts, not their mean.
            rates: whether joint speeds and accelerations enter.
            kinked: whether the objective has kinks where it is largest.
            options: of the rounds and of IPOPT.
        """
        self._model, self._drive, self._options = model, drive, options
        self._worst, self._rates, self._kinked = worst, rates, kinked
        self._tasks: dict[MotionKind, KnotNlp] = {}
        setting = model.setting(model.cell)
        self._numbers = setting.objective.program_size(setting.holding)

    def task(self, kind: MotionKind) -> KnotNlp:
        """The program of a kind at a knot."""
        if kind not in self._tasks:
            model = self._model
            self._tasks[kind] = KnotNlp(
                model.cell, model.objective, self._numbers, self._drive.capacity,
                constraints_of(model.cell, moving=True), kind,
                worst=self._worst, rates=self._rates,
            )  # fmt: skip
        return self._tasks[kind]

    def solved(
        self, case: MotionRequest, q: Array, warm: Multipliers | None = None
    ) -> OptimisedMotion:
        """The best motion near one, (n, N), with demands that a program left out."""
        model, settings = self._model, case.course.settings
        cuts = [
            setting.objective.cuts(setting, model.split(posture[None]))[0]
            for setting, posture in zip(settings, q, strict=True)
        ]
        settled = case.roughly or case.kind in (MotionKind.SHORTEST, MotionKind.SPARING)
        if not model.objective.costly or settled:
            return self._apart(case, q, cuts, warm)
        ends: list[OptimisedMotion] = []

        def solve(
            motion: OptimisedMotion, cuts: list[Cuts], room: float
        ) -> ProgramEnd[OptimisedMotion, list[Cuts]] | None:
            ends.append(self._apart(case, motion.q, cuts, motion.multipliers))
            if not ends[-1].converged:
                return None
            violated = [
                setting.objective.more_cuts(setting, model.split(posture[None]), known)
                for setting, posture, known in zip(settings, ends[-1].q, cuts, strict=True)
            ]
            added = [old if new is None else new for old, new in zip(cuts, violated, strict=True)]
            done = all(new is None for new in violated)
            return ProgramEnd(ends[-1], 0.0, 0.0, None if done else added)

        start = OptimisedMotion(q, case.conditions.duration, False, "", ("", 0, np.inf), warm)
        rounds = 1 + self._options.exchanges
        options = GenerationOptions(rounds=rounds, free_rounds=rounds)
        generate(start, -np.inf, cuts, solve, lambda *_: True, options)
        return ends[-1]

    def _apart(
        self, case: MotionRequest, q: Array, cuts: list[Cuts], warm: Multipliers | None
    ) -> OptimisedMotion:
        """The best motion near one, (n, N), with the pairs of bodies that it ran into."""
        model, course = self._model, case.course
        near = [of_two(witnesses) for witnesses in self._witnesses(course, q, CutOptions().near)]
        met: list[Array] = []
        cold, start, multipliers = case, q, warm
        for _ in range(self._options.collisions):
            motion = self._run(case, near, q, cuts, warm)
            if not motion.converged and case is not cold:
                case, q, warm = cold, start, multipliers
                continue
            if model.bodies is None or not motion.converged:
                break
            hits = self._witnesses(course, motion.q, case.conditions.margin)
            if not any(hits):
                break
            for known in case.met:
                same = (known.kind, known.duration) == (case.kind, case.conditions.duration)
                if same and same_motion(known.q, motion.q):
                    return known.ended
            met.append(motion.q)
            near = [(*known, *hit) for known, hit in zip(near, hits, strict=True)]
            if min(cut.distance for hit in hits for cut in hit) > 0:
                # What is a little too near is mended where it is.
                case, q, warm = replace(case, near=True), motion.q, motion.multipliers
        else:
            motion = replace(motion, converged=False, status="Collision")
        case.met.extend(Met(case.kind, case.conditions.duration, q, motion) for q in met)
        return motion

    def _witnesses(self, course: Course, q: Array, beyond: float) -> list[list[Witness]]:
        """Witnesses at every knot of bodies that are nearer than the clearance and so much more."""
        bodies = self._model.bodies
        if bodies is None:
            return [[] for _ in course.settings]
        return bodies.all_witnesses(course.configurations(q), bodies.clearance + beyond)

    def _run(
        self,
        case: MotionRequest,
        near: Sequence[tuple[Witness, ...]],
        q: Array,
        cuts: list[Cuts],
        warm: Multipliers | None,
    ) -> OptimisedMotion:
        model, course, conditions = self._model, case.course, case.conditions
        task, clearance = self.task(case.kind), None
        if model.bodies is not None and any(near):
            clearance = ClearanceRows(model.bodies, course, near, conditions.margin)
        start = started(model, self._drive, task, course, q, conditions.duration, cuts, case.slack)
        if not np.all(np.isfinite(start)):
            return OptimisedMotion(q, conditions.duration, False, "Singular_Start", ("", 0, np.inf))
        inertial = self._drive.torques.inertial(course)
        parameters = np.array(
            [
                np.concatenate([
                    setting.cell.parameters,
                    setting.objective.program_numbers(setting, cuts[k]),
                    inertial[k],
                    [conditions.duration],
                ])
                for k, setting in enumerate(course.settings)
            ]
        )  # fmt: skip
        lower, upper = self._bounds(len(course), conditions)
        smooth = case.kind in (MotionKind.SMOOTHED, MotionKind.UNLIMITED)
        sharp = self._kinked and not smooth
        return MotionProgram(
            task,
            MotionInputs(
                parameters=parameters,
                duration=conditions.duration,
                smoothness=case.smoothness,
                lower=lower,
                upper=upper,
                speeds=case.speeds,
                held=model.cell.held_knots(len(course)),
                clearance=clearance,
                tightened=tightened(task.constraints, case.shares, case.calm),
                returns=conditions.returns,
                warm=warm,
                near=case.near,
                iterations=self._options.kinked_iterations if sharp else self._options.iterations,
            ),
        ).solve(start)

    def _bounds(self, count: int, conditions: EndConditions) -> tuple[Array, Array]:
        cell = self._model.cell
        lower = np.tile(np.concatenate(cell.lower), (count, 1))
        upper = np.tile(np.concatenate(cell.upper), (count, 1))
        for k, fixed in ((0, conditions.first), (-1, conditions.last)):
            known: Mask = np.isfinite(fixed)
            lower[k, known] = upper[k, known] = fixed[known]
        if conditions.returns:
            # The first knot says it: two fixed ends and their equation are one too many.
            known = np.isfinite(conditions.first)
            lower[-1, known] = np.concatenate(cell.lower)[known] - 1.0
            upper[-1, known] = np.concatenate(cell.upper)[known] + 1.0
        return lower, upper


def same_motion(one: Array, other: Array, tolerance: float = 1e-3) -> bool:
    """True where two motions at the same knots, (n, N), differ by no more than rounding."""
    return bool(np.abs(one - other).max() < tolerance)
