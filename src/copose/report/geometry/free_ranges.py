"""Boxes within which free positions of object, bases and grasps may be."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from copose.poses import Array
from copose.report.geometry.shapes import object_axes
from copose.report.panels import Panel, case_of
from copose.results import FreeRecord


@dataclass(frozen=True, eq=False)
class Range:
    """The box of positions that something may take; flat along what is not free."""

    arm: str | None  # the arm of a base or grasp; None for the object
    what: str  # ``object``, ``base`` or ``grasp``
    edges: Array  # ends of each that has a length, in the world, (e, 2, d)


def ranges(panel: Panel) -> list[Range]:
    """The boxes around the file's positions in which a posture's free positions had to be."""
    posture = panel.posture
    case = f"{case_of(posture)}: " if case_of(posture) else ""
    center = np.array(posture.object.position)
    nothing, world = np.zeros(len(center)), np.eye(len(center))
    boxes = [Range(None, "object", _edges(panel, f"{case}object", center, nothing, world))]
    for arm, base in (posture.base or {}).items():
        position = np.array(base.position)
        boxes.append(Range(arm, "base", _edges(panel, f"{arm}.base", position, nothing, world)))
    axes = object_axes(posture)
    for arm, grasp in (posture.grasp or {}).items():
        position = np.array(grasp.position)
        boxes.append(Range(arm, "grasp", _edges(panel, f"{arm}.grasp", position, center, axes)))
    return [box for box in boxes if len(box.edges)]


def _offset(record: FreeRecord, panel: Panel) -> float | None:
    """The offset of a coordinate from the file's pose in a panel; None where it is not known."""
    earlier = (panel.solution.before, *(panel.solution.cases_before or ()))
    was = any(panel.posture is posture for posture in earlier)
    offset = record.before if was else record.after
    if offset is None and panel.misses and panel.solution.search is not None:
        # A search tells of what it misses at the file's pose, or as near to it as the range has it.
        return min(max(0.0, record.lower), record.upper)
    return offset


def _edges(panel: Panel, name: str, position: Array, origin: Array, axes: Array) -> Array:
    """The edges, (e, 2, d), of the box around a position, (d,), in a frame of the world."""
    records = {record.name: record for record in panel.solution.freedom}
    low, high = position.copy(), position.copy()
    for k, axis in zip(range(len(position)), "xyz", strict=False):
        record = records.get(f"{name}.{axis}")
        offset = None if record is None else _offset(record, panel)
        if record is not None and offset is not None:
            file = position[k] - offset
            low[k], high[k] = file + record.lower, file + record.upper
    return np.asarray(origin + _box_edges(low, high) @ axes.T)


def _box_edges(low: Array, high: Array) -> Array:
    """The edges of a box that have a length, each once, (e, 2, d)."""
    free, edges = [k for k in range(len(low)) if high[k] > low[k]], []
    for axis in free:
        other_axes = [k for k in free if k != axis]
        for corner in product(*((low[k], high[k]) for k in other_axes)):
            edge = np.array([low, low])
            edge[:, other_axes] = corner
            edge[1, axis] = high[axis]
            edges.append(edge)
    return np.array(edges).reshape(-1, 2, len(low))
