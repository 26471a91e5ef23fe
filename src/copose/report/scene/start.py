"""Records of object and arms at their starts, from which their scene is drawn."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.collision import Solid, link_solids
from copose.errors import InputError
from copose.problem import Problem
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


@dataclass(frozen=True, eq=False)
class StartScene:
    """The scene of a problem that has no result yet."""

    problem: ProblemRecord  # the problem as results record it
    posture: Posture  # the starts; without ellipsoids

    @classmethod
    def of(cls, problem: Problem, starts: Sequence[ArmStart], *, bodies: bool = True) -> StartScene:
        """The scene of arms at their starts, with bodies of their links or without."""
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
