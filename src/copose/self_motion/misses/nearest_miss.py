"""Why no posture closes the chain: which arm, by how much it misses, and whether that is sure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.poses import Array, Pose, quaternion_product, rotation_rows
from copose.posture.model import PostureModel
from copose.posture.setting import Setting
from copose.robots import finite_range, freed
from copose.robots.reach_bounds import excluded
from copose.self_motion.least_squares import nearest
from copose.self_motion.projection import CLOSED, project
from copose.self_motion.sampling import ArmSample

# Nearest misses of a sample from which the nearest of all is sought.
_TRIED = 12
# Random postures beside them, where no bound decides, and the quick steps that they take first.
_DRAWN, _BEFORE = 20, 12
# What is a miss, m or rad.
_MISSED = 1e-6
# What the misses of all of them differ by at most where they are one, m or rad.
_ONE = 1e-4
_MISSES_TOLD = 3
# How much more a position counts than an orientation, step by step, where the tip has to be at its
# place, and from how many postures; how much farther than is needed a grasp is turned, that
# rounding leaves room.
_FIRM = (10.0, 100.0, 1000.0)
_TURNING = 6
_TURNED = (1.02, 1.1, 1.25, 1.5)
_DIGITS = 4


@dataclass(frozen=True, eq=False)
class Miss:
    """The nearest that an arm comes to its grasp.

    Attributes:
        q: joint positions there, (n,).
        reason: a sentence with the arm and the gap.
        sure: whether no posture comes nearer for a reason that holds: a bound, or one miss that
            every start comes down to.
    """

    q: Array
    reason: str
    sure: bool


def misses(
    model: PostureModel, setting: Setting, samples: Sequence[ArmSample]
) -> tuple[list[Array], str, bool]:
    """The nearest miss of the first arms that miss, a sentence on each of them, and whether one of
    them is sure.
    """
    joints, reasons, sure = [], [], False
    missing = [i for i, sample in enumerate(samples) if not len(sample.closed)]
    # Those first of which it is sure.
    told = sorted(missing, key=lambda i: not samples[i].proved)[:_MISSES_TOLD]
    for i, sample in enumerate(samples):
        if i in told:
            miss = nearest_miss(model, setting, i, sample)
            sure |= miss.sure
            joints.append(miss.q)
            reasons.append(miss.reason)
        else:
            joints.append((sample.missed if i in missing else sample.closed)[0])
    if len(missing) > len(reasons):
        reasons.append(f"{len(missing) - len(reasons)} more arms miss theirs")
    return joints, "; ".join(reasons), sure


def nearest_miss(model: PostureModel, setting: Setting, i: int, sample: ArmSample) -> Miss:
    """The posture of arm i nearest to its grasp, and what keeps it from it.

    Position first: only where the tip reaches the place is the orientation what is missing. Then
    |Δp|² + (2 sin(θ/2))² is least, m and rad alike.
    """
    cell, kernels, goal = setting.cell, model.arms[i], setting.placement.goals[i]
    space, arm = cell.system.space, cell.arms[i]
    lower, upper = cell.lower[i], cell.upper[i]

    def gap(q: Array) -> tuple[float, float]:
        """How far off the tip is, m and degrees."""
        off = kernels.gap(q[None], goal)[0]
        turned = 2 * math.atan2(float(np.linalg.norm(off[4:])), abs(float(off[3])))
        return float(np.linalg.norm(off[:3])), math.degrees(turned)

    if arm.fixed:
        distance, angle = gap(sample.missed[0])
        turned = f" and {angle:.4g}°" if space.rigid else ""
        reason = f"arm {arm.name!r} is fixed and misses its grasp by {distance:.4g} m{turned}"
        return Miss(sample.missed[0], reason, sure=True)
    proved = sample.proved or excluded(arm, kernels, lower, upper, goal, rigid=space.rigid)
    starts = sample.missed[:_TRIED]
    if not proved:
        drawn = np.random.default_rng(0).uniform(*finite_range(lower, upper), (_DRAWN, arm.n))
        drawn, _ = project(kernels, drawn, goal, lower, upper, steps=_BEFORE)
        starts = np.vstack([starts, drawn])

    def least(weights: Array) -> tuple[Array, bool]:
        """Where the tip is nearest, the nearest first, and whether that is sure."""
        ends, gaps = nearest(kernels, starts, goal, lower, upper, weights=weights)
        one = np.ptp(gaps) <= _ONE and gaps.min() > _MISSED
        return ends[np.argsort(gaps, kind="stable")], bool(proved or one)

    def told(sure: bool) -> str:
        if proved:
            return "; no posture within its limits comes there"
        return "" if sure else f"; as far as {len(starts)} searches tell"

    place = np.zeros(space.m)
    place[list(space.linear)] = 1.0
    ends, sure = least(place)
    distance, _ = gap(ends[0])
    if distance > _MISSED or not space.rigid:
        reason = f"arm {arm.name!r} cannot reach its grasp: the nearest its tip comes is"
        return Miss(cell.folded(i, ends[0]), f"{reason} {distance:.4g} m{told(sure)}", sure)
    there = ends
    ends, sure = least(np.ones(space.m))
    distance, angle = gap(ends[0])
    return Miss(
        cell.folded(i, ends[0]),
        f"arm {arm.name!r} reaches the place of its grasp but not in its orientation: between the "
        f"two, 1 rad counting as 1 m, it misses by {distance:.4g} m and {angle:.4g}°{told(sure)}"
        + _turned(model, setting, i, np.vstack([ends[:_TURNING], there[:_TURNING]])),
        sure,
    )


def _turned(model: PostureModel, setting: Setting, i: int, starts: Array) -> str:
    """The rotation of arm i's grasp with which it would close, next to that which it has; nothing
    where none was found, or the grasp is free as it is.

    Args:
        model: what is built.
        setting: where the object is.
        i: the arm.
        starts: postures from which one at the place of the grasp is sought, (count, n).
    """
    cell, kernels, goal = setting.cell, model.arms[i], setting.placement.goals[i]
    space, arm, limits = cell.system.space, cell.arms[i], (cell.lower[i], cell.upper[i])
    if "grasp" in freed(cell.problem.arms[i]):
        return ""
    weights = np.ones(space.m)
    ends = starts
    for firm in _FIRM:
        weights[list(space.linear)] = firm
        ends, gaps = nearest(kernels, ends, goal, *limits, weights=weights)
        ends = ends[np.argsort(gaps, kind="stable")[:_TURNING]]
    off = kernels.gap(ends[:1], goal)[0, 3:]
    off = off if off[0] >= 0 else -off
    half = math.atan2(float(np.linalg.norm(off[1:])), float(off[0]))
    for factor in _TURNED if half > _MISSED else ():
        if half * factor > math.pi / 2:
            break
        axis = off[1:] / np.linalg.norm(off[1:])
        turn = np.array([math.cos(half * factor), *(math.sin(half * factor) * axis)])
        written, turn = _written(arm.grasp, turn, planar=space.planar)
        place = np.concatenate([goal[:3], quaternion_product(goal[3:], turn)])
        _, gaps = project(kernels, ends, place, *limits)
        if gaps.min() <= CLOSED:
            angle = math.degrees(2 * math.atan2(float(np.linalg.norm(turn[1:])), abs(turn[0])))
            return f"; turned by {angle:.3g}° it would close: {written}"
    return ""


def _written(grasp: Pose, turn: Array, *, planar: bool) -> tuple[str, Array]:
    """A grasp turned about its tip, as a problem file has it, and the turn that is left of what is
    rounded there, a quaternion.
    """
    whole = quaternion_product(grasp.quaternion, turn)
    rpy = Pose.make(grasp.position, rotation_rows(whole), whole).rpy.round(_DIGITS) + 0.0
    back = grasp.quaternion * np.array([1.0, -1.0, -1.0, -1.0])
    turned = np.array(quaternion_product(back, Pose.from_rpy(rpy=rpy).quaternion))
    if planar:
        return f"grasp.angle = {rpy[2]:g}", turned
    return f"grasp.rpy = [{', '.join(f'{angle:g}' for angle in rpy)}]", turned
