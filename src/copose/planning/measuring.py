"""What a posture is worth, from its joint positions alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from copose.capability import RESOLUTIONS, Ellipsoid, zero_torque_acceleration
from copose.kernels import Kernel
from copose.planning.cell import Cell
from copose.poses import Array
from copose.results import ArmRecord, EllipsoidRecord, Posture, matrix, place, vector

# Below this ratio of singular values a Jacobian counts as rank-deficient: nothing that a
# pseudoinverse says of such a direction would be known to a single digit.
RANK_TOLERANCE = 1e-12


@dataclass(frozen=True, eq=False)
class Measurement:
    """A measured posture and what kept numbers from existing.

    Attributes:
        posture: the record of a result.
        ellipsoid: the system's, None where its volume is zero.
        notes: why numbers are missing.
    """

    posture: Posture
    ellipsoid: Ellipsoid | None
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Measures:
    """What many postures are worth; NaN where an arm is singular.

    Attributes:
        objective: the problem's, (count,).
        gram: G of the ellipsoid that is asked for, (count, a, a).
        closure_error: by arm, the larger of a tip's position error, m, and angle error, rad, in the
            linear spaces the position error, (count,).
    """

    objective: Array
    gram: Array
    closure_error: dict[str, Array]


class Meter:
    """Measures postures of one cell; built once, used for every number of a result."""

    def __init__(self, cell: Cell) -> None:
        """Build the functions that evaluate a posture."""
        system = cell.system
        place = system.object.parameters
        self._arms = [
            _Parts(
                arm.q,
                place,
                [
                    *system.pose_error(i),
                    arm.J,
                    cell.resolution.own_factor(arm, scale),
                    arm.skeleton,
                ],
            )
            for i, (arm, scale) in enumerate(zip(system.arms, cell.scales, strict=True))
        ]
        gravity, velocity = ca.SX.sym("gravity", 3), ca.SX.sym("velocity", system.space.m)
        self._factors = _Parts(
            system.q, place, [kind.factor(system, cell.scales) for kind in RESOLUTIONS.values()]
        )
        self._center = _Parts(
            system.q,
            ca.vertcat(place, gravity, velocity),
            [zero_torque_acceleration(system, gravity, velocity)],
        )

    def measure(self, cell: Cell, joints: Sequence[Array]) -> Measurement:
        """The ellipsoids, the closure and the skeletons of a posture.

        Args:
            cell: with the object where it is.
            joints: positions by arm, (n_i,) each.
        """
        m, rows, pose = (
            cell.system.space.m, list(cell.system.space.linear), cell.problem.object.pose,
        )  # fmt: skip
        errors, records, notes = {}, {}, []
        for arm, function, q in zip(cell.arms, self._arms, joints, strict=True):
            gap, turn, J, own, skeleton = function(q, cell.parameters)
            error = closure_errors(gap[rows].T, turn.T, cell.system.space.rigid)
            errors[arm.name] = float(error[0])
            rank = _rank(J)
            if rank < m:
                notes.append(
                    f"volume 0: the Jacobian of arm {arm.name!r} has rank {rank} of {m} here"
                )
            single = _ellipsoid(own) if rank == m else None
            records[arm.name] = ArmRecord(
                skeleton=matrix(skeleton.T),
                grasp=vector((pose @ arm.grasp).position),
                ellipsoid=EllipsoidRecord.of(single),
            )
        ellipsoids: dict[str, Ellipsoid | None] = dict.fromkeys(RESOLUTIONS)
        if not notes:
            whole = self._ellipsoids(cell, joints)
            if any(each is None for each in whole.values()):
                notes.append(
                    "volume unknown: the equations of motion are singular to working precision"
                )
            ellipsoids = {name: _sliced(cell, each) for name, each in whole.items()}
            # Whether the object can be kept at rest is a question for all of its coordinates, and
            # not for least-norm rules.
            optimal = whole["torque-optimal"]
            if optimal is not None and not optimal.contains(np.zeros(m)):
                notes.append(
                    "rest is outside the shifted ellipsoid: torques of the ball cannot keep the "
                    "object from accelerating"
                )
        ellipsoid = ellipsoids[cell.resolution.name]
        posture = Posture(
            joints={arm.name: vector(q) for arm, q in zip(cell.arms, joints, strict=True)},
            object=place(pose, cell.problem.space.planar),
            closure_error=errors,
            ellipsoid=EllipsoidRecord.of(ellipsoid),
            log_volumes={
                name: each.log_volume if each is not None else None
                for name, each in ellipsoids.items()
            },
            arms=records,
        )
        return Measurement(posture, ellipsoid, tuple(notes))

    def _ellipsoids(self, cell: Cell, joints: Sequence[Array]) -> dict[str, Ellipsoid | None]:
        """The system's ellipsoid by each resolution, in all coordinates of the task."""
        q = np.concatenate(joints)
        factors = self._factors(q, cell.parameters)
        center = np.zeros(cell.system.space.m)
        if np.any(cell.gravity) or np.any(cell.velocity):
            moving = np.concatenate([cell.parameters, cell.gravity, cell.velocity])
            center = self._center(q, moving)[0].ravel()
        return {
            name: _ellipsoid(factor, center)
            for name, factor in zip(RESOLUTIONS, factors, strict=True)
        }


def _sliced(cell: Cell, ellipsoid: Ellipsoid | None) -> Ellipsoid | None:
    axes = cell.problem.axes
    if ellipsoid is None or axes == tuple(range(cell.system.space.m)):
        return ellipsoid
    return ellipsoid.sliced(axes)


class _Parts:
    """Several expressions of a posture, (n,), and of parameters, as numbers."""

    def __init__(self, q: ca.SX, parameters: ca.SX, parts: Sequence[ca.SX]) -> None:
        self._shapes = [part.shape for part in parts]
        self._edges = np.cumsum([part.numel() for part in parts])[:-1]
        together = ca.vertcat(*(ca.vec(ca.densify(part)) for part in parts))
        self._kernel = Kernel(q, parameters, together)

    def __call__(self, q: Array, parameters: Array) -> list[Array]:
        values = np.split(self._kernel(q[None], parameters)[0], self._edges)
        return [x.reshape(shape, order="F") for x, shape in zip(values, self._shapes, strict=True)]


def closure_errors(gap: Array, turn: Array, rigid: bool) -> Array:
    """The larger of position error, m, and angle error θ = 2 atan2(|v|, |w|), rad; (count,).

    Args:
        gap: position errors, (count, 3 or 2).
        turn: quaternions of the angle errors, (count, 4).
        rigid: whether the angle counts.
    """
    distance = np.linalg.norm(gap, axis=1)
    angle = 2 * np.arctan2(np.linalg.norm(turn[:, 1:], axis=1), np.abs(turn[:, 0]))
    return np.asarray(np.maximum(distance, angle) if rigid else distance)


def _rank(J: Array) -> int:
    values = np.linalg.svd(J, compute_uv=False)
    return int(np.sum(values > RANK_TOLERANCE * max(values[0], 1e-300)))


def _ellipsoid(factor: Array, center: Array | None = None) -> Ellipsoid | None:
    """The ellipsoid of a factor, or None where it is singular to working precision."""
    try:
        return Ellipsoid.from_factor(factor, center)
    except ValueError:
        return None
