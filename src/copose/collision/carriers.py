"""Frames that solids are fixed to, and their poses at given joint positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from copose.poses import Array, Indices, Pose, rotation_rows
from copose.robots import Arm

# The numbers of a pose in a configuration: position and quaternion [x, y, z, w].
POSE = 7


@dataclass(frozen=True)
class Carrier:
    """A frame that solids are fixed to."""

    # The world; the object; an arm's root frame; a joint's frame, after its motion.
    kind: Literal["world", "object", "root", "joint"]
    arm: int = -1  # number of the arm, −1 for world and object
    joint: int = -1  # number of the arm's free joint, −1 for the root

    @property
    def static(self) -> bool:
        """True for a frame that neither joints nor the object move."""
        return self.kind in ("world", "root")


WORLD, OBJECT = Carrier("world"), Carrier("object")


def carriers_of(arms: Sequence[Arm]) -> tuple[Carrier, ...]:
    """World, object, then root and joints of every arm: the order of `Placements`."""
    carriers = [WORLD, OBJECT]
    for i, arm in enumerate(arms):
        carriers.append(Carrier("root", i))
        carriers += [Carrier("joint", i, j) for j in range(arm.n)]
    return tuple(carriers)


@dataclass(frozen=True, eq=False)
class Placements:
    """Placements of all carriers in the world, in the order of `carriers_of`."""

    rotations: Array  # R_world_carrier, shape (..., c, 3, 3)
    positions: Array  # origins in the world, m, shape (..., c, 3)

    def __getitem__(self, row: int) -> Placements:
        return Placements(self.rotations[row], self.positions[row])


def configurations(
    arms: Sequence[Arm],
    bases: Sequence[Pose],
    q: Sequence[Array | None],
    objects: Pose | Sequence[Pose],
) -> Array:
    """Configurations, one a row, (count, size): the object's pose, then of every arm its root's
    pose and its joints.

    Args:
        arms: the arms.
        bases: T_world_root of each.
        q: joint positions of each, (count, n), or (n,) for all rows; zero for an arm that is None.
        objects: T_world_object, one for all rows or one for each.
    """
    poses = [objects] if isinstance(objects, Pose) else list(objects)
    count = max([len(poses), *(len(np.atleast_2d(own)) for own in q if own is not None)])
    parts = [np.broadcast_to([_numbers(pose) for pose in poses], (count, POSE))]
    for arm, base, own in zip(arms, bases, q, strict=True):
        parts.append(np.broadcast_to(_numbers(base), (count, POSE)))
        joints = np.zeros(arm.n) if own is None else np.asarray(own, dtype=float)
        parts.append(np.broadcast_to(joints, (count, arm.n)))
    return np.hstack(parts)


def joint_columns(arms: Sequence[Arm]) -> Indices:
    """Columns of configurations that are joint positions, (N,)."""
    edges = POSE + np.cumsum([0, *(POSE + arm.n for arm in arms)])
    return np.concatenate([
        edge + POSE + np.arange(arm.n) for edge, arm in zip(edges[:-1], arms, strict=True)
    ])  # fmt: skip


def carrier_poses(arms: Sequence[Arm], x: Array) -> Placements:
    """Placements of all carriers, T_world_root ∏ placement_j · motion_j(q_j), in configurations,
    (count, size).
    """
    count = len(x)
    frames = np.empty((count, 2 + len(arms) + sum(arm.n for arm in arms), 3, 4))
    frames[:, 0] = np.eye(3, 4)
    frames[:, 1, :, :3], frames[:, 1, :, 3] = _rotations(x[:, 3:POSE]), x[:, :3]
    first, k = POSE, 2
    for arm in arms:
        root, q = x[:, first : first + POSE], x[:, first + POSE : first + POSE + arm.n]
        frames[:, k, :, :3], frames[:, k, :, 3] = _rotations(root[:, 3:]), root[:, :3]
        motions = _motions(arm, q)
        for j in range(arm.n):
            np.matmul(frames[:, k, :, :3], motions[:, j], out=frames[:, k + 1])
            frames[:, k + 1, :, 3] += frames[:, k, :, 3]
            k += 1
        first, k = first + POSE + arm.n, k + 1
    return Placements(frames[..., :3], frames[..., 3])


def _numbers(pose: Pose) -> Array:
    """A pose in a configuration: position and quaternion [x, y, z, w], (7,)."""
    w, *xyz = pose.quaternion
    return np.array([*pose.position, *xyz, w])


def _rotations(quaternions: Array) -> Array:
    """Rotations of quaternions [x, y, z, w], (count, 4); (count, 3, 3)."""
    if len(quaternions) > 1 and (quaternions == quaternions[0]).all():
        return np.broadcast_to(_rotations(quaternions[:1]), (len(quaternions), 3, 3))
    x, y, z, w = quaternions.T
    return np.moveaxis(np.array(rotation_rows([w, x, y, z])), 2, 0)


def _motions(arm: Arm, q: Array) -> Array:
    """Poses placement_j · motion_j(q_j) of every joint at positions, (count, n): rotations beside
    positions, (count, n, 3, 4).
    """
    turning, axes, along, skew, rotations, positions = _constants(arm)
    angles = np.where(turning, q, 0.0)[..., None, None]
    turns = along + (np.eye(3) - along) * np.cos(angles) + skew * np.sin(angles)
    shifts = axes * np.where(turning, 0.0, q)[..., None]
    moved = positions + (rotations @ shifts[..., None])[..., 0]
    return np.concatenate([rotations @ turns, moved[..., None]], axis=-1)


@lru_cache(maxsize=64)
def _constants(arm: Arm) -> tuple[Array, ...]:
    """Constants of an arm's joints: which are revolute, (n,); axes, (n, 3); the axes' dyads and
    cross products, (n, 3, 3); rotations and positions of the joints' placements.
    """
    axes = np.reshape([joint.axis for joint in arm.joints], (-1, 3))
    skew = np.cross(axes[:, None], np.eye(3)).transpose(0, 2, 1)
    return (
        np.array([joint.kind == "revolute" for joint in arm.joints], dtype=bool),
        axes,
        axes[:, :, None] * axes[:, None, :],
        skew,
        np.reshape([joint.placement.rotation for joint in arm.joints], (-1, 3, 3)),
        np.reshape([joint.placement.position for joint in arm.joints], (-1, 3)),
    )
