"""Solutions: measured postures of all cases put together into a result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from copose.cell.cell import Cell
from copose.cell.freedom import Freedom
from copose.cell.notes import extreme_notes, once, standing_notes
from copose.measurement.meter import Measurement
from copose.objectives.objective import Objective
from copose.poses import Array
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
class MeasuredCase:
    """A measured posture of one case, and the weight of its objective."""

    measured: Measurement
    weight: float = 1.0


@dataclass(frozen=True, eq=False)
class MeasuredCases:
    """Measured postures of all cases, and where everything that is free is for them.

    Attributes:
        cases: in the file's order.
        free: by case, free coordinates, (d,); None of one posture by itself, of whose place nothing
            is said.
    """

    cases: tuple[MeasuredCase, ...]
    free: tuple[Array, ...] | None = None

    @classmethod
    def single(cls, measured: Measurement) -> MeasuredCases:
        """One posture by itself."""
        return cls((MeasuredCase(measured),))

    @property
    def value(self) -> float:
        """Σ weight · objective, −inf where a case has none."""
        values = [case.measured.value for case in self.cases]
        if any(value is None for value in values):
            return -np.inf
        return sum(c.weight * v for c, v in zip(self.cases, values, strict=True) if v is not None)


def solution_of(
    cell: Cell,
    objective: Objective,
    *,
    status: Status,
    timing: Timing,
    reason: str | None = None,
    notes: tuple[str, ...] = (),
    before: MeasuredCases | None = None,
    after: MeasuredCases | None = None,
    miss: Measurement | None = None,
    search: SearchRecord | None = None,
    reachable: bool | None = None,
    links: tuple[LinkRecord, ...] = (),
) -> Solution:
    """The result of measured postures; ``miss`` is the nearest where none holds the object.

    Notes stand beside those on the cell and on the postures.
    """
    notes = (*standing_notes(cell), *notes)
    for when, postures in (("before", before), ("after", after)):
        measured = [] if postures is None else [case.measured for case in postures.cases]
        own = [note for measurement in measured for note in measurement.notes]
        notes += tuple(f"{when}: {note}" for note in dict.fromkeys(own))
        if when == "after":
            notes += extreme_notes(cell, [measurement.extremes for measurement in measured])
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
    """Limits of every joint, by arm, in the order of the joints."""

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
    return solution_of(cell, objective, status="failed", reason=reason, timing=timing)


def _value(postures: MeasuredCases | None) -> float | None:
    """The objective as a result states it."""
    return postures.value if postures is not None and np.isfinite(postures.value) else None


def _posture(cell: Cell, postures: MeasuredCases | None) -> Posture | None:
    """The one posture; None where there are cases."""
    if postures is None or (postures.free is not None and cell.problem.cases):
        return None
    return postures.cases[0].measured.posture


def _cases(cell: Cell, postures: MeasuredCases | None) -> tuple[CasePosture, ...] | None:
    """The postures of the file's cases; None where there are none."""
    if not cell.problem.cases or postures is None or postures.free is None:
        return None
    records = []
    for spec, case in zip(cell.problem.cases, postures.cases, strict=True):
        posture = case.measured.posture
        given = {key: getattr(posture, key) for key in posture.model_fields_set}
        records.append(
            CasePosture(**given, name=spec.name, weight=case.weight, objective=case.measured.value)
        )
    return tuple(records)


def _freedom(
    cell: Cell, before: MeasuredCases | None, after: MeasuredCases | None
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
                None if postures is None or postures.free is None else float(postures.free[j][k])
                for postures in (before, after)
            ]
            records.append(
                FreeRecord(
                    name=f"{case}: {name}" if case else name,
                    lower=c.lower, upper=c.upper, before=ends[0], after=ends[1],
                )
            )  # fmt: skip
    return tuple(records)


def _open(measured: Measurement) -> Posture:
    """The posture of a miss, without an ellipsoid: arms that do not hold the object have none."""
    posture = measured.posture
    nothing = EllipsoidRecord.of(None)
    volumes = dict.fromkeys(posture.log_volumes)
    return posture.model_copy(update={"ellipsoid": nothing, "log_volumes": volumes})
