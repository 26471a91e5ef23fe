"""Measurements put together into a result."""

from __future__ import annotations

from typing import Literal

from copose.planning.cell import Cell
from copose.planning.measuring import Measurement
from copose.planning.notes import standing_notes
from copose.planning.objectives import Objective
from copose.results import (
    EllipsoidRecord,
    ObjectiveRecord,
    Posture,
    ProblemRecord,
    SearchRecord,
    Solution,
    Timing,
)
from copose.version import __version__


def answer(
    cell: Cell,
    objective: Objective,
    *,
    status: Literal["solved", "infeasible", "failed"],
    timing: Timing,
    reason: str | None = None,
    notes: tuple[str, ...] = (),
    before: Measurement | None = None,
    after: Measurement | None = None,
    miss: Measurement | None = None,
    search: SearchRecord | None = None,
) -> Solution:
    """The result of what was measured."""
    notes = (*standing_notes(cell), *notes)
    for when, measured in (("before", before), ("after", after)):
        if measured is not None:
            notes += tuple(f"{when}: {note}" for note in measured.notes)
    return Solution(
        copose=__version__,
        problem=ProblemRecord(
            name=cell.problem.name,
            space=cell.problem.task.space,
            shape=cell.problem.object.shape,
            axes=tuple(cell.problem.space.coordinates[i] for i in cell.problem.axes),
            resolution=cell.resolution.name,
            torque_scaling=cell.problem.ellipsoid.torque_scaling,
        ),
        status=status,
        reason=reason,
        notes=notes,
        objective=ObjectiveRecord(
            kind=objective.kind,
            unit=objective.unit,
            before=None if before is None else before.value,
            after=None if after is None else after.value,
        ),
        joint_names={arm.name: arm.joint_names for arm in cell.arms},
        unlimited={arm.name: cell.unlimited(i) for i, arm in enumerate(cell.arms)},
        before=before.posture if before is not None else None,
        after=after.posture if after is not None else None,
        nearest_miss=_open(miss) if miss is not None else None,
        search=search,
        timing=timing,
    )


def _open(measured: Measurement) -> Posture:
    """A posture without the system's ellipsoid: arms that do not hold the object have none."""
    posture = measured.posture
    nothing = EllipsoidRecord.of(None)
    volumes = dict.fromkeys(posture.log_volumes)
    return posture.model_copy(update={"ellipsoid": nothing, "log_volumes": volumes})
