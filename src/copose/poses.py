"""A rigid placement as plain numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]


def frozen_array(values: ArrayLike) -> Array:
    """A read-only float64 copy."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def multiply_quaternions(a: ArrayLike, b: ArrayLike) -> Array:
    """Hamilton product a ⊗ b of quaternions [w, x, y, z]."""
    aw, ax, ay, az = np.asarray(a, dtype=float)
    bw, bx, by, bz = np.asarray(b, dtype=float)
    return np.array(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ]
    )


@dataclass(frozen=True, eq=False)
class Pose:
    """Placement of a frame B in a frame A: x_A = rotation @ x_B + position.

    Attributes:
        position: origin of B in A, m, shape (3,).
        rotation: R_A_B, shape (3, 3).
        quaternion: the same rotation as a unit quaternion [w, x, y, z].
    """

    position: Array
    rotation: Array
    quaternion: Array

    @classmethod
    def make(cls, position: ArrayLike, rotation: ArrayLike, quaternion: ArrayLike) -> Pose:
        """A pose from its three parts, copied and made read-only."""
        return cls(frozen_array(position), frozen_array(rotation), frozen_array(quaternion))

    @classmethod
    def from_rpy(cls, position: ArrayLike = (0, 0, 0), rpy: ArrayLike = (0, 0, 0)) -> Pose:
        """Fixed-axis roll, pitch, yaw as in URDF: R = R_z(yaw) R_y(pitch) R_x(roll), rad."""
        roll, pitch, yaw = np.asarray(rpy, dtype=float)
        (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
        rotation = [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
        quaternion = np.array([1.0, 0.0, 0.0, 0.0])
        for axis, angle in ((3, yaw), (2, pitch), (1, roll)):
            turn = np.zeros(4)
            turn[0], turn[axis] = np.cos(angle / 2), np.sin(angle / 2)
            quaternion = multiply_quaternions(quaternion, turn)
        if quaternion[0] < 0:
            quaternion = -quaternion
        return cls.make(position, rotation, quaternion)

    def __matmul__(self, other: Pose) -> Pose:
        return Pose.make(
            self.rotation @ other.position + self.position,
            self.rotation @ other.rotation,
            multiply_quaternions(self.quaternion, other.quaternion),
        )

    def inverse(self) -> Pose:
        """Placement of A in B."""
        conjugate = self.quaternion * np.array([1.0, -1.0, -1.0, -1.0])
        return Pose.make(-self.rotation.T @ self.position, self.rotation.T, conjugate)
