"""Why no posture closes the chain: which arm, by how much it misses, and whether that is sure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from copose.planning.machinery import Machinery, Setting
from copose.planning.reach_bounds import excluded
from copose.planning.self_motion import ArmSample
from copose.poses import Array
from copose.robots import finite_range

# Nearest misses of a sample from which the nearest of all is sought.
_TRIED = 12
# Random postures beside them.
_DRAWN = 20
# What is a miss, m or rad.
_MISSED = 1e-6
# What the misses of all of them differ by at most where they are one, m or rad.
_ONE = 1e-4
_MISSES_TOLD = 3


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
    machinery: Machinery, setting: Setting, samples: Sequence[ArmSample]
) -> tuple[list[Array], str, bool]:
    """The nearest miss of the first arms that miss, a sentence on each of them, and whether one of
    them is sure.
    """
    joints, reasons, sure = [], [], False
    missing = [i for i, sample in enumerate(samples) if not len(sample.closed)]
    for i, sample in enumerate(samples):
        if i in missing[:_MISSES_TOLD]:
            miss = nearest_miss(machinery, setting, i, sample)
            sure |= miss.sure
            joints.append(miss.q)
            reasons.append(miss.reason)
        else:
            joints.append((sample.missed if i in missing else sample.closed)[0])
    if len(missing) > len(reasons):
        reasons.append(f"{len(missing) - len(reasons)} more arms miss theirs")
    return joints, "; ".join(reasons), sure


def nearest_miss(machinery: Machinery, setting: Setting, i: int, sample: ArmSample) -> Miss:
    """The posture of arm i nearest to its grasp, and what keeps it from it.

    Position first: only where the tip reaches the place is the orientation what is missing.
    """
    from scipy.optimize import least_squares

    cell = setting.cell
    system, name = cell.system, cell.arms[i].name
    gap, turn = system.pose_error(i)
    gap = gap[[row for row in system.space.rows if row < 3]]
    inputs = [system.arms[i].q, system.parameters]
    position = _function(inputs, gap)
    full = _function(inputs, system.closure(i))
    pose_error = ca.Function("pose_error", inputs, [gap, turn])

    if cell.arms[i].fixed:
        q = sample.missed[0]
        distance = float(np.linalg.norm(np.array(pose_error(q, cell.parameters)[0])))
        angle = _degrees(np.array(pose_error(q, cell.parameters)[1]))
        turned = f" and {angle:.4g}°" if system.space.rigid else ""
        reason = f"arm {name!r} is fixed and misses its grasp by {distance:.4g} m{turned}"
        return Miss(q, reason, sure=True)
    proved = excluded(
        cell.arms[i], machinery.arms[i], cell.lower[i], cell.upper[i],
        setting.placement.goals[i], rigid=system.space.rigid,
    )  # fmt: skip
    drawn = np.random.default_rng(0).uniform(
        *finite_range(cell.lower[i], cell.upper[i]), (_DRAWN, cell.arms[i].n)
    )
    starts = np.vstack([sample.missed[:_TRIED], drawn])

    def nearest(function: ca.Function) -> tuple[Array, bool]:
        def residual(q: Array) -> Array:
            return np.array(function(q, cell.parameters)[0]).ravel()

        def slope(q: Array) -> Array:
            return np.array(function(q, cell.parameters)[1])

        bounds = (cell.lower[i], cell.upper[i])
        # An interior-point method: from a joint limit itself it cannot start.
        inside = 1e-2 * np.fmin(bounds[1] - bounds[0], 1.0)
        low, high = bounds[0] + inside, bounds[1] - inside
        ends = [
            least_squares(
                residual,
                np.clip(q, low, high),
                jac=slope,
                bounds=bounds,
                xtol=1e-12,
                ftol=1e-12,
                gtol=1e-12,
            )
            for q in starts
        ]
        best = min(ends, key=lambda end: float(end.cost))
        gaps = np.sqrt([2 * end.cost for end in ends])
        one = np.ptp(gaps) <= _ONE and gaps.min() > _MISSED
        return cell.folded(i, np.clip(best.x, *bounds)), bool(one)

    def told(sure: bool) -> str:
        if proved:
            return "; no posture within its limits comes there"
        return "" if sure else f"; as far as {len(starts)} searches tell"

    q, one = nearest(position)
    distance = float(np.linalg.norm(np.array(pose_error(q, cell.parameters)[0])))
    if distance > _MISSED or not system.space.rigid:
        one |= proved
        reason = f"arm {name!r} cannot reach its grasp: the nearest its tip comes is"
        return Miss(q, f"{reason} {distance:.4g} m{told(one)}", one)
    q, one = nearest(full)
    one |= proved
    gap_there, turn_there = (np.array(x).ravel() for x in pose_error(q, cell.parameters))
    return Miss(
        q,
        f"arm {name!r} reaches the place of its grasp but not in its orientation: between the two "
        f"it misses by {float(np.linalg.norm(gap_there)):.4g} m and {_degrees(turn_there):.4g}°"
        + told(one),
        one,
    )


def _degrees(turn: Array) -> float:
    """The angle of a quaternion."""
    turn = turn.ravel()
    return math.degrees(2 * math.atan2(float(np.linalg.norm(turn[1:])), abs(float(turn[0]))))


def _function(inputs: list[ca.SX], residual: ca.SX) -> ca.Function:
    return ca.Function("residual", inputs, [residual, ca.jacobian(residual, inputs[0])])
