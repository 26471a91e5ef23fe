"""Forward kinematics: frames of an arm's joints and tip as CasADi expressions of its joints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import casadi as ca
import numpy as np

from copose.poses import Array, Pose, quaternion_product, rotation_rows, skew
from copose.robots import Arm, Joint


def constant(values: Array) -> ca.SX:
    """An expression of numbers in which zeros and ones cost nothing.

    A right angle in radians leaves entries like 6e-17 in a rotation: these count as zero.
    """
    whole = np.rint(values)
    rounded = np.abs(values - whole) <= 1e-15 * min(1.0, np.abs(values).max())
    return ca.SX(ca.sparsify(ca.DM(np.where(rounded, whole, values))))


def multiply_quaternions(a: ca.SX, b: ca.SX) -> ca.SX:
    """Hamilton product a ⊗ b of quaternions [w, x, y, z]."""
    product: ca.SX = _quaternion_product()(a, b)
    return product


@cache
def _quaternion_product() -> ca.Function:
    """The product as a function: expressions take it over in one call, not in thirty."""
    a, b = ca.SX.sym("a", 4), ca.SX.sym("b", 4)
    product = ca.vertcat(*quaternion_product(ca.vertsplit(a), ca.vertsplit(b)))
    return ca.Function("quaternion_product", [a, b], [product])


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame in another: origin, axes, and the quaternion of its rotation."""

    position: ca.SX
    rotation: ca.SX
    quaternion: ca.SX

    @classmethod
    def at(cls, pose: Pose) -> Frame:
        """The constant frame of a pose."""
        return cls(*map(constant, (pose.position, pose.rotation, pose.quaternion)))

    @classmethod
    def free(cls, name: str) -> tuple[Frame, ca.SX]:
        """A frame with symbols for its placement, and these: position, quaternion, (7,)."""
        numbers = ca.SX.sym(name, 7)
        position, quaternion = numbers[:3], numbers[3:]
        return cls(position, ca.blockcat(rotation_rows(quaternion)), quaternion), numbers

    @property
    def inverse_quaternion(self) -> ca.SX:
        """The quaternion of the rotation back."""
        return self.quaternion * ca.DM([1, -1, -1, -1])

    def moved(self, pose: Pose) -> Frame:
        """The frame that ``pose`` places in this one."""
        return Frame(
            self.position + self.rotation @ constant(pose.position),
            self.rotation @ constant(pose.rotation),
            multiply_quaternions(self.quaternion, constant(pose.quaternion)),
        )


@dataclass(frozen=True, eq=False)
class Chain:
    """Frames of an arm at joint positions q, in its root frame.

    The root frame and not the world's: what is computed far from the origin loses digits.
    """

    arm: Arm
    q: ca.SX  # joint positions, (n,)
    frames: tuple[Frame, ...]  # joint frames after each joint's motion, root to tip
    axes: tuple[ca.SX, ...]  # unit joint axes, (3,) each
    tip: Frame  # tip frame

    @classmethod
    def of(cls, arm: Arm, q: ca.SX, *, halved: bool = False) -> Chain:
        """The chain of an arm at joint positions q, by sines of them, or of half of them alone."""
        frame = Frame(ca.SX(3, 1), ca.SX.eye(3), ca.SX(ca.DM([1, 0, 0, 0])))
        frames, axes = [], []
        for i, joint in enumerate(arm.joints):
            frame = _turned(frame.moved(joint.placement), joint, q[i], halved)
            frames.append(frame)
            axes.append(frame.rotation @ constant(joint.axis))
        return cls(arm, q, tuple(frames), tuple(axes), frame.moved(arm.tip))

    def jacobian(self) -> ca.SX:
        """Geometric Jacobian of the tip's origin, linear over angular, root axes, (6, n)."""
        columns = []
        for joint, frame, axis in zip(self.arm.joints, self.frames, self.axes, strict=True):
            if joint.kind == "revolute":
                arm_to_tip = self.tip.position - frame.position
                columns.append(ca.vertcat(ca.cross(axis, arm_to_tip), axis))
            else:
                columns.append(ca.vertcat(axis, ca.SX(3, 1)))
        return ca.horzcat(*columns)


def _turned(frame: Frame, joint: Joint, q: ca.SX, halved: bool) -> Frame:
    """The frame after its joint has moved by q."""
    if joint.kind == "prismatic":
        shift = frame.rotation @ constant(joint.axis) * q
        return Frame(frame.position + shift, frame.rotation, frame.quaternion)
    along = np.outer(joint.axis, joint.axis)
    across, turned = np.eye(3) - along, skew(joint.axis)
    half_angle = q / 2
    c, s = ca.cos(half_angle), ca.sin(half_angle)
    cosine, sine = (1 - 2 * s**2, 2 * c * s) if halved else (ca.cos(q), ca.sin(q))
    turn = constant(along) + constant(across) * cosine + constant(turned) * sine
    half = ca.vertcat(c, constant(joint.axis) * s)
    return Frame(
        frame.position, frame.rotation @ turn, multiply_quaternions(frame.quaternion, half)
    )
