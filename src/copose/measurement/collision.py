"""The smallest distance of bodies at a posture and broken constraints, as a result states them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from copose.cell.cell import Cell
from copose.collision import Bodies
from copose.constraints.clearance import configurations_of
from copose.constraints.posture_constraint import PostureConstraint
from copose.measurement.meter import Measurement
from copose.poses import Array
from copose.results import CollisionRecord


def with_collision(cell: Cell, measured: Measurement, bodies: Bodies) -> Measurement:
    """A measured posture with its smallest distance."""
    joints = [np.array(q) for q in measured.posture.joints.values()]
    nearest = bodies.nearest(configurations_of(cell, joints)[0])
    if nearest is None:
        return measured
    record = CollisionRecord(distance=nearest.distance, pair=nearest.pair)
    posture = measured.posture.model_copy(update={"collision": record})
    return replace(measured, posture=posture)


def noted(measured: Measurement, constraints: Sequence[PostureConstraint]) -> Measurement:
    """A measured posture with notes on the constraints that it breaks."""
    notes = [constraint.note(measured.posture) for constraint in constraints]
    told = [note for note in notes if note is not None]
    return replace(measured, notes=(*measured.notes, *told)) if told else measured


def overlap_notes(cell: Cell, bodies: Bodies, joints: Sequence[Array]) -> tuple[str, ...]:
    """A note where bodies overlap at a posture, by arm (n_i,), that nothing keeps apart."""
    pair = bodies.overlapping(configurations_of(cell, joints)[0])
    if pair is None:
        return ()
    return (f"{pair[0]} and {pair[1]} overlap; [constraints] collision = true keeps them apart",)
