"""Nearest misses: postures of arms that cannot reach their grasps, with the gap in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.cell.cell import Cell
from copose.poses import Array, Pose, conjugate, quaternion_product, rotation_rows
from copose.robots import finite_range, freed
from copose.self_motion.kernels import ArmKernels
from copose.self_motion.least_squares import nearest
from copose.self_motion.misses.branch_and_bound import excluded
from copose.self_motion.projection import CLOSED, project
from copose.self_motion.sampling import ArmSample


@dataclass(frozen=True)
class MissOptions:
    """Effort of the search for an arm's nearest miss, and what of it is told."""

    starts: int = 12  # misses of a sample from which the search starts
    drawn: int = 20  # random postures from which it starts too, where no bound decides
    quick_steps: int = 12  # steps of projection that random postures take first
    missed: float = 1e-6  # gap that is more than rounding, m or rad
    same: float = 1e-4  # difference up to which two misses are one, m or rad
    told: int = 3  # arms in a result's reason
    position_weights: tuple[float, ...] = (10.0, 100.0, 1000.0)  # against orientation, in turn
    turned_from: int = 6  # postures from which a turned grasp is sought
    turn_factors: tuple[float, ...] = (1.02, 1.1, 1.25, 1.5)  # of the turn that is needed
    digits: int = 4  # of the angles of a grasp as told


@dataclass(frozen=True, eq=False)
class Miss:
    """The nearest miss of an arm: the posture at the least gap to its grasp."""

    q: Array  # joint positions, (n,)
    reason: str  # a sentence with the arm and the gap
    # Whether no posture comes nearer, by a bound, or because every start has led to the same miss.
    sure: bool


def misses(
    cell: Cell,
    kernels: Sequence[ArmKernels],
    goals: Sequence[Array],
    samples: Sequence[ArmSample],
    options: MissOptions = MissOptions(),
) -> tuple[list[Array], str, bool]:
    """Nearest misses of all arms that miss their grasps.

    Args:
        cell: with the object where it is.
        kernels: by arm.
        goals: of the tips, by arm, see `KernelInputs`.
        samples: by arm.
        options: effort and what is told.

    Returns:
        A posture by arm, (n_i,), a sentence on each of the first arms that miss, and whether one of
        these is sure.
    """
    joints, reasons, sure = [], [], False
    missing = [i for i, sample in enumerate(samples) if not len(sample.closed)]
    # Proved misses come first.
    told = sorted(missing, key=lambda i: not samples[i].proved)[: options.told]
    for i, sample in enumerate(samples):
        if i in told:
            miss = miss_of(cell, kernels[i], goals[i], i, sample, options)
            sure |= miss.sure
            joints.append(miss.q)
            reasons.append(miss.reason)
        else:
            joints.append((sample.missed if i in missing else sample.closed)[0])
    if len(missing) > len(reasons):
        reasons.append(f"{len(missing) - len(reasons)} more arms miss theirs")
    return joints, "; ".join(reasons), sure


def miss_of(
    cell: Cell,
    kernels: ArmKernels,
    goal: Array,
    i: int,
    sample: ArmSample,
    options: MissOptions = MissOptions(),
) -> Miss:
    """The posture of arm i nearest to its grasp, and what keeps it from it.

    Position first: only where the tip reaches the place is the orientation what is missing. Then
    |Δp|² + (2 sin(θ/2))² is least, m and rad alike.
    """
    space, arm = cell.system.space, cell.arms[i]
    lower, upper = cell.lower[i], cell.upper[i]

    def gap(q: Array) -> tuple[float, float]:
        """Distance and angle of the tip from its goal, m and degrees."""
        off = kernels.gap(q[None], goal)[0]
        turned = 2 * math.atan2(float(np.linalg.norm(off[4:])), abs(float(off[3])))
        return float(np.linalg.norm(off[:3])), math.degrees(turned)

    if arm.fixed:
        distance, angle = gap(sample.missed[0])
        turned = f" and {angle:.4g}°" if space.rigid else ""
        reason = f"arm {arm.name!r} is fixed and misses its grasp by {distance:.4g} m{turned}"
        return Miss(sample.missed[0], reason, sure=True)
    proved = sample.proved or excluded(arm, kernels, lower, upper, goal, rigid=space.rigid)
    starts = sample.missed[: options.starts]
    if not proved:
        drawn = np.random.default_rng(0).uniform(
            *finite_range(lower, upper), (options.drawn, arm.n)
        )
        drawn, _ = project(kernels, drawn, goal, lower, upper, steps=options.quick_steps)
        starts = np.vstack([starts, drawn])

    def least(weights: Array) -> tuple[Array, bool]:
        """Postures with the least weighted gap, nearest first, and whether the miss is sure."""
        ends, gaps = nearest(kernels, starts, goal, lower, upper, weights=weights)
        one = np.ptp(gaps) <= options.same and gaps.min() > options.missed
        return ends[np.argsort(gaps, kind="stable")], bool(proved or one)

    def evidence(sure: bool) -> str:
        if proved:
            return "; no posture within its limits comes there"
        return "" if sure else f"; as far as {len(starts)} searches tell"

    place = np.zeros(space.m)
    place[list(space.linear)] = 1.0
    ends, sure = least(place)
    distance, _ = gap(ends[0])
    if distance > options.missed or not space.rigid:
        reason = f"arm {arm.name!r} cannot reach its grasp: the nearest its tip comes is"
        return Miss(cell.folded(i, ends[0]), f"{reason} {distance:.4g} m{evidence(sure)}", sure)
    at_place = ends
    ends, sure = least(np.ones(space.m))
    distance, angle = gap(ends[0])
    most = options.turned_from
    return Miss(
        cell.folded(i, ends[0]),
        f"arm {arm.name!r} reaches the place of its grasp but not in its orientation: between the "
        f"two, 1 rad counting as 1 m, it misses by {distance:.4g} m and {angle:.4g}°"
        + evidence(sure)
        + _turned(cell, kernels, goal, i, np.vstack([ends[:most], at_place[:most]]), options),
        sure,
    )


def _turned(
    cell: Cell, kernels: ArmKernels, goal: Array, i: int, starts: Array, options: MissOptions
) -> str:
    """The grasp of arm i, turned as little as lets the arm close, in words.

    Empty where none was found, or where the grasp is free anyway.

    Args:
        cell: with the object where it is.
        kernels: of the arm.
        goal: of its tip, (7,).
        i: its number.
        starts: postures from which one at the place of the grasp is sought, (count, n).
        options: effort of the search.
    """
    space, arm, limits = cell.system.space, cell.arms[i], (cell.lower[i], cell.upper[i])
    if "grasp" in freed(cell.problem.arms[i]):
        return ""
    weights = np.ones(space.m)
    ends = starts
    for weight in options.position_weights:
        weights[list(space.linear)] = weight
        ends, gaps = nearest(kernels, ends, goal, *limits, weights=weights)
        ends = ends[np.argsort(gaps, kind="stable")[: options.turned_from]]
    off = kernels.gap(ends[:1], goal)[0, 3:]
    off = off if off[0] >= 0 else -off
    half = math.atan2(float(np.linalg.norm(off[1:])), float(off[0]))
    for factor in options.turn_factors if half > options.missed else ():
        if half * factor > math.pi / 2:
            break
        axis = off[1:] / np.linalg.norm(off[1:])
        turn = np.array([math.cos(half * factor), *(math.sin(half * factor) * axis)])
        written, turn = _written(arm.grasp, turn, options.digits, planar=space.planar)
        place = np.concatenate([goal[:3], quaternion_product(goal[3:], turn)])
        _, gaps = project(kernels, ends, place, *limits)
        if gaps.min() <= CLOSED:
            angle = math.degrees(2 * math.atan2(float(np.linalg.norm(turn[1:])), abs(turn[0])))
            return f"; turned by {angle:.3g}° it would close: {written}"
    return ""


def _written(grasp: Pose, turn: Array, digits: int, *, planar: bool) -> tuple[str, Array]:
    """A turned grasp as a problem file has it, and the quaternion of the turn after rounding.

    Args:
        grasp: placement of the tip in the object.
        turn: about the tip, a quaternion, (4,).
        digits: of the angles.
        planar: whether the problem is planar.
    """
    whole = quaternion_product(grasp.quaternion, turn)
    rpy = Pose.make(grasp.position, rotation_rows(whole), whole).rpy.round(digits) + 0.0
    written = Pose.from_rpy(rpy=rpy).quaternion
    turned = np.array(quaternion_product(conjugate(grasp.quaternion), written))
    if planar:
        return f"grasp.angle = {rpy[2]:g}", turned
    return f"grasp.rpy = [{', '.join(f'{angle:g}' for angle in rpy)}]", turned
