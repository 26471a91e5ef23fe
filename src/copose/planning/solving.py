"""From a problem to a better posture."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.planning.answering import answer
from copose.planning.cell import Cell
from copose.planning.closing import CLOSED, Projector
from copose.planning.measuring import Measurement, Meter
from copose.planning.missing import nearest_miss
from copose.planning.notes import margin_notes
from copose.planning.objectives import Objective, objective_of
from copose.planning.program import PostureProgram
from copose.planning.search import (
    ArmSample,
    Polished,
    Progress,
    Screen,
    distinct_starts,
    polish,
    sample_arm,
)
from copose.poses import Array
from copose.problem import Problem
from copose.results import Optimum, SearchRecord, Solution, Timing

# What a returned posture may miss its grasp by, m or rad.
CLOSURE_TOLERANCE = 1e-8
_NUDGES = 8
_MISSES_TOLD = 3


@dataclass(frozen=True, eq=False)
class Planner:
    """What is built once for a problem: expressions, functions, the posture program."""

    cell: Cell
    objective: Objective
    meter: Meter
    projectors: tuple[Projector, ...]
    screen: Screen
    program: PostureProgram
    build_s: float

    @classmethod
    def of(cls, problem: Problem) -> Planner:
        """Build everything that solving needs.

        Raises:
            InputError: a robot cannot be used.
        """
        began = time.perf_counter()
        cell = Cell.of(problem)
        objective = objective_of(problem)
        return cls(
            cell=cell,
            objective=objective,
            meter=Meter(cell),
            projectors=tuple(Projector(cell.system, i) for i in range(len(cell.arms))),
            screen=Screen(cell, objective),
            program=PostureProgram(cell.system, cell.gram, objective),
            build_s=time.perf_counter() - began,
        )

    def closed(self, i: int, q: Array) -> Array | None:
        """Joints of arm i as they are where they hold the object, else projected, or None."""
        projector, cell = self.projectors[i], self.cell
        residual, _ = projector.residuals(q[None], cell.parameters)
        if np.linalg.norm(residual) <= CLOSED:
            return q
        # A stretched arm has no slope to follow; from a little beside it there is one.
        nudges = np.random.default_rng(0).normal(size=(_NUDGES, len(q)))
        beside = np.vstack([q, q + nudges * np.geomspace(1e-3, 0.1, _NUDGES)[:, None]])
        ends, gaps = projector.project(beside, cell.parameters, cell.lower[i], cell.upper[i])
        closed = np.flatnonzero(gaps <= CLOSED)
        return np.asarray(ends[closed[0]]) if len(closed) else None


def _within(cell: Cell, i: int, q: Array) -> bool:
    return bool(np.all((q >= cell.lower[i]) & (q <= cell.upper[i])))


def solve(problem: Problem, *, progress: Progress | None = None) -> Solution:
    """The posture in which the arms accelerate the object best.

    Args:
        problem: as read by `copose.load`.
        progress: called with what is being done and the fraction of the whole behind.

    Returns:
        A solution whose ``status`` is ``solved``; ``infeasible`` where an arm cannot reach its
        grasp, with the arm and the gap as ``reason`` and the nearest miss; or ``failed``.

    Raises:
        InputError: a robot cannot be used.
    """
    tell = progress if progress is not None else _silent
    tell("building", 0.0)
    planner = Planner.of(problem)
    began = time.perf_counter()
    cell = planner.cell
    samples = []
    for i, projector in enumerate(planner.projectors):
        tell(f"closing arm {cell.arms[i].name}", 0.1 + 0.4 * i / len(cell.arms))
        samples.append(sample_arm(cell, projector, i))

    def timing() -> Timing:
        return Timing(build_s=planner.build_s, search_s=time.perf_counter() - began)

    if any(len(sample.closed) == 0 for sample in samples):
        joints, reason = _misses(cell, samples)
        return answer(
            cell,
            planner.objective,
            status="infeasible",
            reason=reason,
            miss=planner.meter.measure(joints),
            search=_record(cell, 0, None),
            timing=timing(),
        )
    before, notes = _before(planner, samples)
    tell("comparing postures", 0.5)
    rng = np.random.default_rng([problem.search.seed, len(cell.arms)])
    closed = [sample.closed for sample in samples]
    ranked = planner.screen.best_first(closed, cell.parameters, rng)
    starts = [*distinct_starts(cell, closed, ranked), np.concatenate(_joints(before, cell))]
    polished = polish(
        cell, planner.program, starts, lambda what, done: tell(what, 0.5 + 0.5 * done)
    )
    notes += _failures(polished, len(starts))
    after = _best(planner, polished, before)
    return answer(
        cell,
        planner.objective,
        status="failed" if after is None else "solved",
        reason=_why(planner.program, polished, before) if after is None else None,
        notes=notes,
        before=before,
        after=after,
        search=_record(cell, len(starts), polished),
        timing=timing(),
    )


def _silent(what: str, done: float) -> None:
    """No one asked to be told."""


def _joints(measurement: Measurement, cell: Cell) -> list[Array]:
    return [np.array(measurement.posture.joints[arm.name]) for arm in cell.arms]


def _misses(cell: Cell, samples: Sequence[ArmSample]) -> tuple[list[Array], str]:
    """The nearest miss of the first arms that miss, and a sentence on each of them."""
    joints, reasons = [], []
    missing = [i for i, sample in enumerate(samples) if not len(sample.closed)]
    for i, sample in enumerate(samples):
        if i in missing[:_MISSES_TOLD]:
            miss = nearest_miss(cell, i, sample)
            joints.append(miss.q)
            reasons.append(miss.reason)
        else:
            joints.append((sample.missed if i in missing else sample.closed)[0])
    if len(missing) > len(reasons):
        reasons.append(f"{len(missing) - len(reasons)} more arms miss theirs")
    return joints, "; ".join(reasons)


def _before(planner: Planner, samples: Sequence[ArmSample]) -> tuple[Measurement, tuple[str, ...]]:
    """The start of the file, closed, or the first closed posture that the seed gives."""
    cell = planner.cell
    joints, notes = [], []
    for i, (arm, sample) in enumerate(zip(cell.arms, samples, strict=True)):
        q = planner.closed(i, arm.start) if arm.start is not None else sample.closed[0]
        if q is None:
            q = sample.closed[0]
            notes.append(
                f"the start of arm {arm.name!r} could not be projected onto its grasp; the first "
                "closed posture of the seed stands in for it"
            )
        joints.append(q)
    return planner.meter.measure(joints), (*notes, *margin_notes(cell, joints))


def _best(planner: Planner, polished: Polished, before: Measurement) -> Measurement | None:
    """The best optimum that passes its own check, or the start where none is better."""
    cell, value = planner.cell, planner.objective.of
    best = None
    for optimum in polished.optima:
        joints = [planner.closed(i, q) for i, q in enumerate(cell.system.split(optimum.q))]
        if any(q is None for q in joints):
            continue
        measured = planner.meter.measure([q for q in joints if q is not None])
        if (
            measured.ellipsoid is not None
            and max(measured.posture.closure_error.values()) <= CLOSURE_TOLERANCE
            and abs(value(measured.ellipsoid) - optimum.objective) <= 1e-6
        ):
            best = measured
            break
    allowed = all(_within(cell, i, q) for i, q in enumerate(_joints(before, cell)))
    if best is None or best.ellipsoid is None or before.ellipsoid is None or not allowed:
        return best
    return before if value(best.ellipsoid) < value(before.ellipsoid) else best


def _record(cell: Cell, starts: int, polished: Polished | None) -> SearchRecord:
    optima = polished.optima if polished is not None else ()
    return SearchRecord(
        seed=cell.problem.search.seed,
        starts=starts,
        local_optima=tuple(Optimum(objective=o.objective, count=o.count) for o in optima),
    )


def _failures(polished: Polished, starts: int) -> tuple[str, ...]:
    if not polished.failures:
        return ()
    ways = sorted({end.status for end in polished.failures})
    return (f"{len(polished.failures)} of {starts} local solves failed: {', '.join(ways)}",)


def _why(program: PostureProgram, polished: Polished, before: Measurement) -> str:
    if before.ellipsoid is None and before.notes:
        return before.notes[0]
    if not polished.failures:
        return "no local optimum passed its own check of closure and objective"
    units = {constraint.name: constraint.unit for constraint in program.constraints}
    worst = [
        f"{name} {violation:.1e} {units[name]}"
        for name, violation in polished.failures[0].violations.items()
        if violation > CLOSURE_TOLERANCE
    ]
    return f"no local solve converged: {polished.failures[0].status} {', '.join(worst)}".strip()
