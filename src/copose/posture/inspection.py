"""Inspection of a problem file before anything is solved."""

from __future__ import annotations

from dataclasses import dataclass

from copose.cell.cell import Cell
from copose.cell.notes import once, standing_notes
from copose.collision import Scene
from copose.collision.links.robot_links import large_links
from copose.kernels import one_at_a_time
from copose.posture.start_postures import starts
from copose.problem import Problem
from copose.robots import Arm, ArmStart


@dataclass(frozen=True, eq=False)
class Check:
    """A problem that can be solved: its chains as they were read, and what is doubtful.

    Attributes:
        problem: as asked.
        arms: its chains.
        starts: where they are before anything is solved.
        notes: what is doubtful.
    """

    problem: Problem
    arms: tuple[Arm, ...]
    starts: tuple[ArmStart, ...]
    notes: tuple[str, ...]


@one_at_a_time
def check(problem: Problem) -> Check:
    """Read the robots of a problem and look for what is wrong or doubtful.

    Raises:
        InputError: what is wrong.
    """
    cell = Cell.of(problem)
    notes = standing_notes(cell, everything=True)
    if problem.constraints.collision:
        notes += Scene.of(problem, cell.arms).notes
    else:
        notes += large_links(problem)
    return Check(problem, cell.arms, starts(cell), once(notes))
