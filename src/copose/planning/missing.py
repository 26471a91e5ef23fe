"""Why no posture closes the chain: which arm, and by how much it misses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from copose.planning.cell import Cell
from copose.planning.self_motion import ArmSample
from copose.poses import Array

_TRIED = 12
_MISSES_TOLD = 3


@dataclass(frozen=True, eq=False)
class Miss:
    """The nearest that an arm comes to its grasp.

    Attributes:
        q: joint positions there, (n,).
        reason: a sentence with the arm and the gap.
    """

    q: Array
    reason: str


def misses(cell: Cell, samples: Sequence[ArmSample]) -> tuple[list[Array], str]:
    """The nearest miss of the first arms that miss, and a sentence on each of them."""
    joints, reasons = [], []
    missing = [i for i, sample in enumerate(samples) if not len(sample.closed)]
    for i, sample in enumerate(samples):
        if i in missing[:_MISSES_TOLD]:
            miss = nearest_miss(cell, i, sample)
            joints.append(miss.q)
            reasons.append(miss.reason)
        else:
            joints.append((sample.missed if i in missing else sample.closed)[0])
    if len(missing) > len(reasons):
        reasons.append(f"{len(missing) - len(reasons)} more arms miss theirs")
    return joints, "; ".join(reasons)


def nearest_miss(cell: Cell, i: int, sample: ArmSample) -> Miss:
    """The posture of arm i nearest to its grasp, and what keeps it from it.

    Position first: only where the tip reaches the place is the orientation what is missing.
    """
    from scipy.optimize import least_squares

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
        return Miss(q, f"arm {name!r} is fixed and misses its grasp by {distance:.4g} m{turned}")

    def nearest(function: ca.Function) -> Array:
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
            for q in sample.missed[:_TRIED]
        ]
        best = min(ends, key=lambda end: float(end.cost))
        return cell.folded(i, np.clip(best.x, *bounds))

    q = nearest(position)
    distance = float(np.linalg.norm(np.array(pose_error(q, cell.parameters)[0])))
    if distance > 1e-6 or not system.space.rigid:
        return Miss(
            q, f"arm {name!r} cannot reach its grasp: the nearest its tip comes is {distance:.4g} m"
        )
    q = nearest(full)
    gap_there, turn_there = (np.array(x).ravel() for x in pose_error(q, cell.parameters))
    return Miss(
        q,
        f"arm {name!r} reaches the place of its grasp but not in its orientation: between the two "
        f"it misses by {float(np.linalg.norm(gap_there)):.4g} m and {_degrees(turn_there):.4g}°",
    )


def _degrees(turn: Array) -> float:
    """The angle of a quaternion."""
    turn = turn.ravel()
    return math.degrees(2 * math.atan2(float(np.linalg.norm(turn[1:])), abs(float(turn[0]))))


def _function(inputs: list[ca.SX], residual: ca.SX) -> ca.Function:
    return ca.Function("residual", inputs, [residual, ca.jacobian(residual, inputs[0])])
