"""Constraint generation with a trust box: solve, add what the end violates, solve again nearby."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

Point = TypeVar("Point")
CutSet = TypeVar("CutSet")


@dataclass(frozen=True)
class GenerationOptions:
    """Bounds on how many programs follow each other, and how far each may go."""

    rounds: int = 20  # programs at most
    free_rounds: int = 6  # the first of them, which go on from wherever the one before led
    shrink: float = 0.3  # of the way, how far the next may go after one that led astray
    smallest_box: float = 1e-6  # rad or m, that is worth another program
    always_bounded: bool = False  # whether the box shrinks in free rounds too
    patient: bool = False  # whether a program that fails is followed by one that stays nearer
    stuck_way: float = 0.0  # rad or m, the way of a program that fails or does not move
    last_rejection: int = 1000  # the round from which one that leads astray is the last
    least_gain: float = -np.inf  # that is worth another program
    gain_round: int = 0  # the round after which that is asked


@dataclass(frozen=True, eq=False)
class ProgramEnd(Generic[Point, CutSet]):
    """The end of one program.

    Attributes:
        point: where it ended.
        value: of the objective itself there.
        way: the largest move of a variable, rad or m.
        cuts: for the next program; None where it left out nothing that counts there.
    """

    point: Point
    value: float
    way: float
    cuts: CutSet | None


def generate(
    start: Point,
    value: float,
    cuts: CutSet,
    solve: Callable[[Point, CutSet, float], ProgramEnd[Point, CutSet] | None],
    accepts: Callable[[ProgramEnd[Point, CutSet], float, bool], bool],
    options: GenerationOptions,
) -> Point:
    """The best accepted end of programs that each start where one before ended.

    A program that leaves out some constraints may lead to where those count, and to less than it
    began with. After such a one the next may go less far.

    Args:
        start: of the first program, and the answer where no end is accepted.
        value: of the objective there.
        cuts: what the first program has.
        solve: one program from a point with some cuts, no variable farther than so much; None where
            it fails.
        accepts: whether an end is better than the best value so far, and whether one was accepted
            before.
        options: when another program follows.
    """
    best, origin, room, accepted = start, start, np.inf, False
    for k in range(options.rounds):
        if k >= options.free_rounds:
            origin = best
        step = solve(origin, cuts, room)
        if step is None and not options.patient:
            break
        if step is not None and accepts(step, value, accepted):
            gain = step.value - value
            best, origin, value, accepted = step.point, step.point, step.value, True
            if step.cuts is None and step.way < room * (1 - 1e-6):
                break
            if gain <= options.least_gain and k > options.gain_round:
                break
        else:
            origin = best if step is None else step.point
            if k >= options.free_rounds or options.always_bounded:
                way = options.stuck_way if step is None or step.way <= 0 else step.way
                room = min(room, way) * options.shrink
                if room < options.smallest_box or k >= options.last_rejection:
                    break
        if step is not None and step.cuts is not None:
            cuts = step.cuts
    return best
