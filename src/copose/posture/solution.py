"""Measurements put together into a result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from copose.cell.cell import Cell
from copose.cell.freedom import Freedom
from copose.cell.notes import extreme_notes, once, standing_notes
from copose.measurement.meter import Measurement
from copose.objectives.objective import Objective
from copose.posture.placement.search import Placed
from copose.progress import StoppedError
from copose.results import (
    CasePosture,
    EllipsoidRecord,
    FreeRecord,
    JointRecord,
    LinkRecord,
    ObjectiveRecord,
    Posture,
    ProblemRecord,
    SearchRecord,
    Solution,
    Timing,
)
from copose.version import __version__

Status: TypeAlias = Literal["solved", "infeasible", "failed"]


@dataclass(frozen=True, eq=False)
class Case:
    """A measured posture of one case, and how much it counts."""

    measured: Measurement
    weight: float


@dataclass(frozen=True, eq=False)
class Placing:
    """Measured postures of all cases, and where everything that is free is for them."""

    placed: Placed
    cases: tuple[Case, ...]

    @property
    def value(self) -> float:
        """Σ weight · objective, −inf where a case has none."""
        values = [case.measured.value for case in self.cases]
        if any(value is None for value in values):
            return -np.inf
        return sum(c.weight * v for c, v in zip(self.cases, values, strict=True) if v is not None)


def answer(
    cell: Cell,
    objective: Objective,
    *,
    status: Status,
    timing: Timing,
    reason: str | None = None,
    notes: tuple[str, ...] = (),
    before: Measurement | Placing | None = None,
    after: Measurement | Placing | None = None,
    miss: Measurement | None = None,
    search: SearchRecord | None = None,
    reachable: bool | None = None,
    links: tuple[LinkRecord, ...] = (),
) -> Solution:
    """The result of what was measured."""
    notes = (*standing_notes(cell), *notes)
    for when, measured in (("before", before), ("after", after)):
        each = [measured] if isinstance(measured, Measurement) else []
        if isinstance(measured, Placing):
            each = [case.measured for case in measured.cases]
        said = [note for one in each for note in one.notes]
        notes += tuple(f"{when}: {note}" for note in dict.fromkeys(said))
        if when == "after":
            notes += extreme_notes(cell, [one.extremes for one in each])
    return Solution(
        copose=__version__,
        problem=ProblemRecord.of(cell.problem, links),
        status=status,
        reason=reason,
        notes=once(notes),
        objective=ObjectiveRecord(
            kind=objective.kind, unit=objective.unit, before=_value(before), after=_value(after)
        ),
        joint_names={arm.name: arm.joint_names for arm in cell.arms},
        limits=joint_limits(cell),
        unlimited={arm.name: cell.unlimited(i) for i, arm in enumerate(cell.arms)},
        before=_posture(cell, before),
        after=_posture(cell, after),
        nearest_miss=_open(miss) if miss is not None else None,
        search=search,
        timing=timing,
        freedom=_freedom(cell, before, after),
        cases=_cases(cell, after),
        cases_before=_cases(cell, before),
        reachable_from_start=reachable,
    )


def joint_limits(cell: Cell) -> dict[str, tuple[JointRecord, ...]]:
    """Of every joint, by arm."""

    def finite(value: float) -> float | None:
        return float(value) if np.isfinite(value) else None

    return {
        arm.name: tuple(
            JointRecord(
                lower=finite(low),
                upper=finite(high),
                velocity=finite(joint.velocity),
                acceleration=finite(joint.acceleration),
                torque=finite(joint.effort),
            )
            for joint, low, high in zip(arm.joints, lower, upper, strict=True)
        )
        for arm, lower, upper in zip(cell.arms, cell.lower, cell.upper, strict=True)
    }


def unfound(cell: Cell, objective: Objective, stop: StoppedError, timing: Timing) -> Solution:
    """The result of a call that had to end before it found anything."""
    reason = f"{stop}: nothing was found yet"
    return answer(cell, objective, status="failed", reason=reason, timing=timing)


def _value(measured: Measurement | Placing | None) -> float | None:
    if measured is None or isinstance(measured, Measurement):
        return None if measured is None else measured.value
    return measured.value if np.isfinite(measured.value) else None


def _posture(cell: Cell, measured: Measurement | Placing | None) -> Posture | None:
    """The one posture; None where there are cases."""
    if isinstance(measured, Placing):
        several = len(measured.cases) > 1 or cell.problem.cases
        return None if several else measured.cases[0].measured.posture
    return None if measured is None else measured.posture


def _cases(cell: Cell, measured: Measurement | Placing | None) -> tuple[CasePosture, ...] | None:
    if not cell.problem.cases or not isinstance(measured, Placing):
        return None
    found = []
    for spec, case in zip(cell.problem.cases, measured.cases, strict=True):
        posture = case.measured.posture
        given = {key: getattr(posture, key) for key in posture.model_fields_set}
        found.append(
            CasePosture(**given, name=spec.name, weight=case.weight, objective=case.measured.value)
        )
    return tuple(found)


def _freedom(
    cell: Cell, before: Measurement | Placing | None, after: Measurement | Placing | None
) -> tuple[FreeRecord, ...]:
    """Offsets of what is free; the object's for every case."""
    freedom = Freedom.of(cell.problem)
    cases = [case.name for case in cell.problem.cases] or [""]
    records = []
    for k, (c, name) in enumerate(
        zip(freedom.coordinates, freedom.names(cell.problem), strict=True)
    ):
        for j, case in enumerate(cases if c.arm is None else [""]):
            ends = [
                float(each.placed.x[j][k]) if isinstance(each, Placing) else None
                for each in (before, after)
            ]
            records.append(
                FreeRecord(
                    name=f"{case}: {name}" if case else name,
                    lower=c.lower, upper=c.upper, before=ends[0], after=ends[1],
                )
            )  # fmt: skip
    return tuple(records)


def _open(measured: Measurement) -> Posture:
    """A posture without the system's ellipsoid: arms that do not hold the object have none."""
    posture = measured.posture
    nothing = EllipsoidRecord.of(None)
    volumes = dict.fromkeys(posture.log_volumes)
    return posture.model_copy(update={"ellipsoid": nothing, "log_volumes": volumes})
