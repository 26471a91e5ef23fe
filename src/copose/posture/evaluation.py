"""Evaluation of a given posture, and verification of a result's numbers."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from copose.cell.cell import Cell
from copose.cell.freedom import Freedom
from copose.cell.notes import margin_notes
from copose.collision import Scene
from copose.constraints.registry import constraints_of
from copose.errors import InputError, arm_key
from copose.kernels import one_at_a_time
from copose.measurement.collision import noted, overlap_notes, with_collision
from copose.measurement.meter import Measurement, Meter
from copose.objectives.objective import Objective
from copose.objectives.registry import objective_of
from copose.poses import Array
from copose.posture.solution import MeasuredCase, MeasuredCases, solution_of
from copose.problem import Problem
from copose.progress import Tell, stage, watched
from copose.results import EllipsoidRecord, LinkRecord, Posture, Solution, Timing, link_records


@one_at_a_time
def evaluate(
    problem: Problem,
    joints: Mapping[str, Sequence[float]] | Solution | None = None,
    *,
    progress: Tell | None = None,
) -> Solution:
    """The ellipsoids of a posture, neither projected nor optimised.

    Args:
        problem: as read by `copose.load`.
        joints: joint positions by arm, rad or m; default the ``start`` of every arm. Of a result
            its ``after``, with what is free where it has it; else that is where the file has it.
        progress: called with a `copose.Progress` as stages begin.

    Returns:
        A solution with the posture as ``after``; ``infeasible`` where it is open or breaks a limit.

    Raises:
        InputError: an arm has no start, ``joints`` do not fit the arms, or the problem has both
            cases and freedom.
    """
    with watched(progress):
        return _evaluated(problem, joints)


def _evaluated(
    problem: Problem, joints: Mapping[str, Sequence[float]] | Solution | None
) -> Solution:
    began = time.perf_counter()
    stage("building")
    cell, freedom = Cell.of(problem), Freedom.of(problem)
    if len(freedom) and problem.cases:
        raise InputError(
            "and freedom ask for several postures; evaluate takes one: leave out either",
            key="cases",
            file=problem.source,
        )
    x = freedom.nominal
    if isinstance(joints, Solution):
        if joints.cases is not None:
            raise InputError("are several postures; evaluate takes one", key="cases")
        if joints.after is None:
            raise InputError("has no posture: null", key="after")
        x, joints = freedom.stated(problem, joints, "after"), joints.after.joints
    cell = freedom.at(cell, x)
    q = _starts(cell) if joints is None else cell.given(joints)
    meter = Meter(cell)
    built = time.perf_counter()
    stage("measuring")
    measured = meter.measure(cell, q, everything=True)
    notes = margin_notes(cell, q)
    stage("measuring distances")
    links: tuple[LinkRecord, ...] = ()
    try:
        scene = Scene.of(cell.problem, cell.arms)
    except InputError:
        # Robots without shapes are no fault where none is asked for.
        if problem.constraints.collision:
            raise
    else:
        links = link_records(scene.solids, cell.arms, planar=scene.planar)
        bodies = scene.bodies(cell.arms, problem.constraints.clearance)
        if problem.constraints.collision:
            measured = with_collision(cell, measured, bodies)
            notes += scene.notes
        else:
            notes += overlap_notes(cell, bodies, q)
    measured = noted(measured, constraints_of(cell))
    timing = Timing(build_s=built - began, search_s=time.perf_counter() - built)
    free = (x,) if len(freedom) else None
    return stated(cell, meter.objective, q, measured, timing, links, notes=notes, free=free)


def stated(
    cell: Cell,
    objective: Objective,
    q: Sequence[Array],
    measured: Measurement,
    timing: Timing,
    links: tuple[LinkRecord, ...],
    *,
    notes: tuple[str, ...] = (),
    free: tuple[Array, ...] | None = None,
) -> Solution:
    """The result of a given posture, by arm (n_i,): ``infeasible`` where it is open or breaks a
    limit.

    Notes stand beside those on the cell and on the posture. Of free coordinates, (d,), of the one
    case nothing is said where they are None.
    """
    fault = next(faults(cell, q, measured), None)
    after = MeasuredCases((MeasuredCase(measured),), free)
    return solution_of(
        cell,
        objective,
        status="solved" if fault is None else "infeasible",
        reason=fault,
        notes=notes,
        after=after if fault is None else None,
        miss=None if fault is None else measured,
        timing=timing,
        links=links,
    )


def _starts(cell: Cell) -> list[Array]:
    starts = []
    for i, arm in enumerate(cell.arms):
        if arm.start is None:
            raise InputError(
                "missing; to evaluate a posture give every arm a start, or name a result",
                key=f"{arm_key(i, arm.name)}.start",
                file=cell.problem.source,
            )
        starts.append(arm.start)
    return starts


def faults(
    cell: Cell, q: Sequence[Array], measured: Measurement, tolerance: float = 1e-6
) -> Iterator[str]:
    """Limits that a posture, by arm (n_i,), breaks and grasps that it misses, a sentence each.

    Up to the tolerance, m or rad, it may.
    """
    for arm, positions in zip(cell.arms, q, strict=True):
        for joint, position in zip(arm.joints, positions, strict=True):
            beyond = max(joint.lower - position, position - joint.upper)
            if beyond > tolerance:
                yield (
                    f"arm {arm.name!r}: joint {joint.name!r} at {position:.6g} is {beyond:.4g} "
                    f"beyond its limits {joint.lower:g} … {joint.upper:g}"
                )
    for name, error in measured.posture.closure_error.items():
        if error > tolerance:
            unit = "m or rad" if cell.system.space.rigid else "m"
            yield f"arm {name!r} misses its grasp by {error:.4g} {unit}"


@one_at_a_time
def verify(problem: Problem, solution: Solution) -> tuple[str, ...]:
    """Recompute every number of a result from its joints; say what does not agree.

    Returns:
        One sentence per disagreement beyond 1e-8 relative; empty where the result is right.
    """
    given, freedom = Cell.of(problem), Freedom.of(problem)
    meter = Meter(given)
    objective = meter.objective
    names = [case.name for case in problem.cases] or [""]
    weights = [case.weight for case in problem.cases] or [1.0]
    wrong = []
    if (solution.objective.kind, solution.objective.unit) != (objective.kind, objective.unit):
        wrong.append(f"the objective is {objective.kind}, in {objective.unit}")
    for when, postures in (
        ("before", solution.cases_before or (solution.before,)),
        ("after", solution.cases or (solution.after,)),
    ):
        if len(postures) != len(names):
            wrong.append(f"{when}: {len(names)} cases are expected")
            continue
        total: float | None = 0.0
        for name, weight, case, posture in zip(names, weights, given.cases, postures, strict=True):
            if posture is None:
                total = None
                continue
            cell = freedom.at(case, freedom.stated(problem, solution, when, name))
            aim = objective_of(cell) if name else objective
            value, disagreements = _remeasured(cell, meter.toward(aim), posture)
            where = f"{when}, {name}" if name else when
            wrong += [f"{where}: {disagreement}" for disagreement in disagreements]
            total = None if total is None or value is None else total + weight * value
        if total is not None and not _near(getattr(solution.objective, when), total):
            wrong.append(f"{when}: the objective is {total!r}")
    return tuple(wrong)


def _remeasured(cell: Cell, meter: Meter, posture: Posture) -> tuple[float | None, list[str]]:
    """Objective of a posture's joints, and what of the posture does not follow from them."""
    joints = cell.given(posture.joints)
    everything = "companions" in posture.model_fields_set
    measured = meter.measure(cell, joints, everything=everything)
    wrong = [*faults(cell, joints, measured), *_differences(posture, measured.posture)]
    return measured.value, wrong


def _differences(stated: Posture, measured: Posture) -> Iterator[str]:
    pairs = [("ellipsoid", stated.ellipsoid, measured.ellipsoid)]
    for name, arm in measured.arms.items():
        if name not in stated.arms:
            yield f"arms.{name} is missing"
            continue
        pairs.append((f"arms.{name}.ellipsoid", stated.arms[name].ellipsoid, arm.ellipsoid))
        for key in ("skeleton", "quaternions", "grasp"):
            if not _near(getattr(stated.arms[name], key), getattr(arm, key)):
                yield f"arms.{name}.{key} does not follow from the joints"
        if abs(stated.closure_error.get(name, np.inf) - measured.closure_error[name]) > 1e-8:
            yield f"closure_error.{name} does not follow from the joints"
    for name, volume in measured.log_volumes.items():
        if not _near(stated.log_volumes.get(name), volume):
            yield f"log_volumes.{name} does not follow from the joints"
    for where, one, other in pairs:
        for key in EllipsoidRecord.model_fields:
            if not _near(getattr(one, key), getattr(other, key)):
                yield f"{where}.{key} does not follow from the joints"
    for what in ("base", "grasp"):
        frames = getattr(measured, what) or {}
        for name, placed in frames.items():
            told = (getattr(stated, what) or {}).get(name)
            for key, number in placed:
                if told is None or not _near(getattr(told, key, None), number):
                    yield f"{what}.{name}.{key} is not what freedom says"
    for key, value in measured.object:
        if not _near(getattr(stated.object, key, None), value):
            yield f"object.{key} is not the problem's"


def _near(one: object, other: object) -> bool:
    if one is None or other is None:
        return one is other
    a, b = np.array(one, dtype=float), np.array(other, dtype=float)
    return a.shape == b.shape and bool(
        np.allclose(a, b, rtol=1e-8, atol=1e-8 * max(float(np.abs(b).max()), 1e-300))
    )
