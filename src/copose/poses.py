"""Rigid placements and rotations as plain numbers: matrices, quaternions, angles, vectors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]
Mask: TypeAlias = NDArray[np.bool_]
Indices: TypeAlias = NDArray[np.intp]


def frozen_array(values: ArrayLike) -> Array:
    """A read-only float64 copy."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def quaternion_product(a: Any, b: Any) -> list[Any]:
    """Hamilton product a ⊗ b of quaternions [w, x, y, z], of numbers or of expressions."""
    return [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]


def rotation_rows(quaternion: Any) -> list[list[Any]]:
    """Rotation matrix of a unit quaternion [w, x, y, z], of numbers or of expressions."""
    w, x, y, z = (quaternion[i] for i in range(4))
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]


def conjugate(quaternion: Array) -> Array:
    """The quaternion [w, x, y, z] of the rotation back, (4,)."""
    return np.asarray(quaternion * np.array([1.0, -1.0, -1.0, -1.0]))


def rotation_vector(quaternion: ArrayLike) -> Array:
    """Axis times shortest angle, rad, of the rotation of a unit quaternion [w, x, y, z], (3,)."""
    w, *v = np.asarray(quaternion)
    if w < 0:
        w, v = -w, [-x for x in v]
    size = np.linalg.norm(v)
    if size < 1e-300:
        return np.zeros(3)
    return np.asarray(np.array(v) / size * 2 * np.arctan2(size, w))


def turn_quaternions(vectors: Array) -> Array:
    """Unit quaternions [w, x, y, z], (..., 4), of rotation vectors, rad, (..., 3)."""
    angle = np.linalg.norm(vectors, axis=-1, keepdims=True)
    # sin(θ/2)/θ, without a quotient of zeros.
    return np.concatenate([np.cos(angle / 2), np.sinc(angle / (2 * np.pi)) / 2 * vectors], axis=-1)


def skew(vector: Array) -> Array:
    """The matrix S(v) with S(v) a = v × a, (3, 3)."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


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
        angles = np.asarray(rpy, dtype=float)
        # Plain numbers: a quarter of the time.
        (cr, cp, cy), (sr, sp, sy) = np.cos(angles).tolist(), np.sin(angles).tolist()
        rotation = [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
        quaternion = [1.0, 0.0, 0.0, 0.0]
        halves = zip(np.cos(angles / 2).tolist(), np.sin(angles / 2).tolist(), strict=True)
        for axis, (c, s) in sorted(enumerate(halves, start=1), reverse=True):
            turn = [c, 0.0, 0.0, 0.0]
            turn[axis] = s
            quaternion = quaternion_product(quaternion, turn)
        if quaternion[0] < 0:
            quaternion = [-part for part in quaternion]
        return cls.make(position, rotation, quaternion)

    @classmethod
    def from_quaternion(cls, position: ArrayLike, quaternion: ArrayLike) -> Pose:
        """A pose by its quaternion [w, x, y, z], of any norm above zero."""
        unit = np.asarray(quaternion, dtype=float)
        unit = unit / np.linalg.norm(unit)
        return cls.make(position, rotation_rows(unit), unit)

    @classmethod
    def from_rotation(cls, rotation: Array, position: ArrayLike = (0, 0, 0)) -> Pose:
        """A pose by its rotation matrix, (3, 3)."""
        # 4 q qᵀ of the unit quaternion q, whose longest row is the safest multiple of it.
        a, b, c = rotation
        products = np.array([
            [1 + a[0] + b[1] + c[2], c[1] - b[2], a[2] - c[0], b[0] - a[1]],
            [c[1] - b[2], 1 + a[0] - b[1] - c[2], a[1] + b[0], a[2] + c[0]],
            [a[2] - c[0], a[1] + b[0], 1 - a[0] + b[1] - c[2], b[2] + c[1]],
            [b[0] - a[1], a[2] + c[0], b[2] + c[1], 1 - a[0] - b[1] + c[2]],
        ])  # fmt: skip
        row = products[int(np.diag(products).argmax())]
        return cls.from_quaternion(position, -row if row[0] < 0 else row)

    @property
    def rpy(self) -> Array:
        """Fixed-axis roll, pitch, yaw, (3,), to working precision at pitches of ±90° too."""
        R = self.rotation
        pitch = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
        roll = np.arctan2(R[2, 1], R[2, 2])
        # What is left without the roll: near ±90° the two are known only together.
        left = R @ Pose.from_rpy(rpy=(-roll, 0.0, 0.0)).rotation
        return np.array([roll, pitch, np.arctan2(-left[0, 1], left[1, 1])])

    @property
    def plain_rpy(self) -> Array:
        """Roll, pitch, yaw that are equal for equal frames, (3,).

        At pitches of ±90°, where only roll ∓ yaw is known, yaw is 0; and −π is written as π.
        """
        near = 1e-6  # to ±90° or −180°, rad
        roll, pitch, yaw = self.rpy
        if abs(abs(pitch) - np.pi / 2) <= near:
            roll, yaw = roll - np.copysign(1.0, pitch) * yaw, 0.0
        angles = np.pi - np.mod(np.pi - np.array([roll, pitch, yaw]), 2 * np.pi)
        return np.where(angles < near - np.pi, angles + 2 * np.pi, angles)

    def __matmul__(self, other: Pose) -> Pose:
        return Pose.make(
            self.rotation @ other.position + self.position,
            self.rotation @ other.rotation,
            quaternion_product(self.quaternion, other.quaternion),
        )

    def displaced(self, offsets: Mapping[str, float], turn: str) -> Pose:
        """B moved along the axes of A by x, y, z, m, and turned by an angle, rad, about its origin.

        Args:
            offsets: by name; what it leaves out is zero.
            turn: ``yaw``, about A's z axis; ``twist``, about B's own.
        """
        about = Pose.from_rpy(rpy=(0.0, 0.0, offsets.get(turn, 0.0)))
        rotation_alone = Pose.make(np.zeros(3), self.rotation, self.quaternion)
        turned = about @ rotation_alone if turn == "yaw" else rotation_alone @ about
        shift = [offsets.get(name, 0.0) for name in "xyz"]
        return Pose.make(self.position + shift, turned.rotation, turned.quaternion)

    def inverse(self) -> Pose:
        """Placement of A in B."""
        position, quaternion = -self.rotation.T @ self.position, conjugate(self.quaternion)
        return Pose.make(position, self.rotation.T, quaternion)
