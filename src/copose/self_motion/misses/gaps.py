"""The gaps between arms and their grasps from where they are, without a search."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.poses import Array
from copose.posture.model import PostureModel
from copose.posture.setting import Setting
from copose.results import Solution
from copose.self_motion.least_squares import nearest
from copose.self_motion.projection import CLOSED, project

# Closures farther apart than this are misses, m or rad.
_MISSED = 1e-6
# Postures beside the present one from which the nearest is sought.
_BESIDE = 1
# Standard deviation of their joints, rad or m.
_SPREAD = 0.3


@dataclass(frozen=True)
class Gap:
    """The distance that is left between a tip and its grasp at the nearest posture.

    Attributes:
        distance: m.
        angle: rad; zero where the tip cannot come to the place, or contacts turn freely. Beside an
            angle the distance is what is left between the two, 1 rad counting as 1 m.
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


def nearest_gaps(model: PostureModel, setting: Setting, joints: Sequence[Array]) -> dict[str, Gap]:
    """The gaps of those arms that cannot close near where they are, by arm (n_i,)."""
    gaps = {}
    for i, (arm, q) in enumerate(zip(setting.cell.arms, joints, strict=True)):
        gap = None if arm.fixed else _gap(model, setting, i, q)
        if gap is not None:
            gaps[arm.name] = gap
    return gaps


def _gap(model: PostureModel, setting: Setting, i: int, q: Array) -> Gap | None:
    """The gap of arm i, None where it closes; the place counts first, as in reports of a search."""
    kernels, goal = model.arms[i], setting.placement.goals[i]
    lower, upper = setting.lower[i], setting.upper[i]
    space = setting.cell.system.space
    beside = np.random.default_rng(0).normal(scale=_SPREAD, size=(_BESIDE, len(q)))
    starts = np.clip(np.vstack([q, q + beside]), lower, upper)
    ends, norms = project(kernels, starts, goal, lower, upper)
    if norms.min() <= CLOSED:
        return None
    place = np.zeros(space.m)
    place[list(space.linear)] = 1.0
    ends, norms = nearest(kernels, starts, goal, lower, upper, weights=place)
    angle = 0.0
    if norms.min() <= _MISSED and space.rigid:
        ends, norms = nearest(kernels, ends, goal, lower, upper)
        turn = kernels.gap(ends[[norms.argmin()]], goal)[0, 3:]
        angle = 2 * math.atan2(float(np.linalg.norm(turn[1:])), abs(float(turn[0])))
    off = kernels.gap(ends[[norms.argmin()]], goal)[0]
    distance = float(np.linalg.norm(off[:3]))
    return Gap(distance, angle) if max(distance, angle) > _MISSED else None
