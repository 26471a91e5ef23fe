"""Where object and arms are before anything is solved, as tables and records."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rich.console import RenderableType
from rich.text import Text

from copose.collision import Solid, link_solids
from copose.errors import InputError
from copose.poses import Array
from copose.problem import Problem
from copose.report.text.columns import aligned, table
from copose.results import (
    ArmRecord,
    EllipsoidRecord,
    Posture,
    ProblemRecord,
    link_records,
    matrix,
    place,
    vector,
)
from copose.robots import ArmStart


def start_table(problem: Problem, starts: Sequence[ArmStart]) -> list[RenderableType]:
    """The object's frame and every tip's, and by how much each arm misses its grasp."""
    planar = problem.space.planar
    frames = [("object", "world", problem.object.pose)]
    for start in starts:
        frames.append((f"{start.arm.name}: tip", "world", start.tip))
        frames.append(("", "object", start.tip_in_object))
        frames.append((f"{start.arm.name}: grasp", "object", start.arm.grasp))
    places = [
        (pose.position[:2], pose.rpy[2:]) if planar else (pose.position, pose.plain_rpy)
        for _, _, pose in frames
    ]
    columns = [aligned(list(map(_numbers, part)), "  ") for part in zip(*places, strict=True)]
    titles = "at the start", "in", "position, m", "angle, rad" if planar else "rpy, rad"
    rows = [(what, within, *cells)
            for (what, within, _), *cells in zip(frames, *columns, strict=True)]  # fmt: skip
    return [table(titles, rows), *(Text(start_words(start)) for start in starts)]


def start_words(start: ArmStart) -> str:
    """Whether an arm holds the object at its start, and by how much it misses its grasp."""
    name = f"arm {start.arm.name!r}"
    if start.given:
        if start.closed:
            return f"{name} holds the object at its start"
        moved = "" if start.arm.fixed else "; solve projects it onto the grasp where it can"
        return f"{name} misses its grasp by {start.miss} at its start{moved}"
    if start.closed:
        return f"{name} has no start; a random posture holds the object"
    both = ", in position and turn together," if start.rigid else ""
    return f"{name} has no start; of many random postures the nearest{both} misses by {start.miss}"


@dataclass(frozen=True, eq=False)
class StartScene:
    """What a scene needs of a problem that has no result yet.

    Attributes:
        problem: as results tell of it.
        posture: of the starts; without ellipsoids.
    """

    problem: ProblemRecord
    posture: Posture

    @classmethod
    def of(cls, problem: Problem, starts: Sequence[ArmStart], *, bodies: bool = True) -> StartScene:
        """The scene of arms at their starts, with bodies of their links if wanted."""
        planar, nothing = problem.space.planar, EllipsoidRecord.of(None)
        arms = [start.arm for start in starts]
        solids: tuple[Solid, ...] = ()
        # A robot whose shapes cannot be read is drawn by its joints alone.
        with contextlib.suppress(InputError):
            solids = link_solids(problem, arms).solids if bodies else ()
        record = ProblemRecord.of(problem, link_records(solids, arms, planar=planar))
        records = {
            start.arm.name: ArmRecord(
                skeleton=matrix(np.array([frame.position for frame in start.frames])),
                quaternions=matrix(np.array([frame.quaternion for frame in start.frames])),
                grasp=vector(start.grasp.position),
                ellipsoid=nothing,
            )
            for start in starts
        }
        posture = Posture(
            joints={start.arm.name: vector(start.joints) for start in starts},
            object=place(problem.object.pose, planar),
            closure_error={start.arm.name: max(start.gap, start.turn) for start in starts},
            ellipsoid=nothing,
            log_volumes={},
            arms=records,
        )
        return cls(record, posture)


def _numbers(values: Sequence[float] | Array) -> list[str]:
    return [f"{round(float(value), 4) + 0.0:.4f}" for value in values]
