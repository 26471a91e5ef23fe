"""Gaps between arms and their grasps near given postures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.cell.cell import Cell
from copose.poses import Array
from copose.problem import Space
from copose.results import Solution
from copose.self_motion.kernels import ArmKernels
from copose.self_motion.least_squares import nearest
from copose.self_motion.projection import CLOSED, project


@dataclass(frozen=True)
class GapOptions:
    """Effort of the search for the gap of one arm."""

    missed: float = 1e-6  # gap that is more than rounding, m or rad
    drawn: int = 1  # postures next to the present one from which the nearest is sought
    deviation: float = 0.3  # standard deviation of their joints, rad or m


@dataclass(frozen=True)
class Gap:
    """The gap between a tip and its grasp at the nearest posture.

    Attributes:
        distance: m.
        angle: rad; zero where the tip cannot reach the place, or contacts turn freely. Otherwise
            distance and angle are least together, 1 rad counting as 1 m.
    """

    distance: float
    angle: float


@dataclass(frozen=True, eq=False)
class Followed:
    """The local optimum that a posture leads to.

    Attributes:
        solution: None where there is none.
        gaps: of the arms that miss their grasps, by name; empty where all close, and limits on
            torques or bodies are in the way of a solution.
    """

    solution: Solution | None
    gaps: dict[str, Gap]


def nearest_gaps(
    cell: Cell,
    kernels: Sequence[ArmKernels],
    goals: Sequence[Array],
    lower: Sequence[Array],
    upper: Sequence[Array],
    joints: Sequence[Array],
    options: GapOptions = GapOptions(),
) -> dict[str, Gap]:
    """Gaps of the arms that cannot close near given postures, by name.

    Args:
        cell: with the object where it is.
        kernels: by arm.
        goals: of the tips, by arm, see `KernelInputs`.
        lower: joint limits by arm, (n_i,).
        upper: alike.
        joints: the postures, by arm, (n_i,).
        options: effort of the search.
    """
    gaps = {}
    for i, (arm, q) in enumerate(zip(cell.arms, joints, strict=True)):
        gap = None
        if not arm.fixed:
            space = cell.system.space
            gap = _gap(space, kernels[i], goals[i], lower[i], upper[i], q, options)
        if gap is not None:
            gaps[arm.name] = gap
    return gaps


def _gap(
    space: Space,
    kernels: ArmKernels,
    goal: Array,
    lower: Array,
    upper: Array,
    q: Array,
    options: GapOptions,
) -> Gap | None:
    """The gap of one arm, None where it closes; the position counts first, as in `misses`."""
    next_to = np.random.default_rng(0).normal(scale=options.deviation, size=(options.drawn, len(q)))
    starts = np.clip(np.vstack([q, q + next_to]), lower, upper)
    ends, norms = project(kernels, starts, goal, lower, upper)
    if norms.min() <= CLOSED:
        return None
    place = np.zeros(space.m)
    place[list(space.linear)] = 1.0
    ends, norms = nearest(kernels, starts, goal, lower, upper, weights=place)
    angle = 0.0
    if norms.min() <= options.missed and space.rigid:
        ends, norms = nearest(kernels, ends, goal, lower, upper)
        turn = kernels.gap(ends[[norms.argmin()]], goal)[0, 3:]
        angle = 2 * math.atan2(float(np.linalg.norm(turn[1:])), abs(float(turn[0])))
    off = kernels.gap(ends[[norms.argmin()]], goal)[0]
    distance = float(np.linalg.norm(off[:3]))
    return Gap(distance, angle) if max(distance, angle) > options.missed else None
