"""Choice of the object's place and of grasps, by the number of random postures that close."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.cell.cell import Cell
from copose.poses import Array, Pose
from copose.robots import finite_range
from copose.self_motion.kernels import ArmKernels
from copose.self_motion.projection import CLOSED, project
from copose.setup.hands import Hand, toward
from copose.setup.layout import Place


@dataclass(frozen=True)
class GraspOptions:
    """Effort of the choice of place and grasps."""

    drawn: int = 48  # random postures that are closed at every place
    chosen_drawn: int = 512  # alike at the chosen place
    enough: int = 30  # of the few that close, at which a place is taken
    steps: int = 20  # of projection at a place
    near: float = 1e-6  # residual of a posture that counts at a place, m or rad


@dataclass(frozen=True, eq=False)
class GraspedObject:
    """The placement of an object and the grasps of all arms on it."""

    object: Pose  # T_world_object
    grasps: tuple[Pose, ...]  # T_object_tip by arm
    # Joints by arm, (n,); None of an arm that does not come to its grasp.
    starts: tuple[Array | None, ...]


def choose(
    cell: Cell, kernels: Sequence[ArmKernels], hands: Sequence[Hand],
    groups: Sequence[Sequence[Place]], size: Array, options: GraspOptions = GraspOptions(),
) -> GraspedObject:  # fmt: skip
    """The place and grasps at which the arm that closes least often closes most often.

    The first place at which it closes often enough is taken.

    Args:
        cell: with the arms on their bases.
        kernels: by arm.
        hands: alike.
        groups: places of the object; those of the first group in which all arms close count.
        size: of the box that is held, m, (3,).
        options: effort.
    """
    drawn = [_drawn(cell, i, options.drawn) for i in range(len(cell.arms))]
    best: tuple[int, int] = (-1, -1)
    object_pose, grasps = Pose.from_rpy(), [Pose.from_rpy()] * len(hands)
    for group in groups:
        for place in group:
            placed = Pose.from_rpy(np.round(place.position, 3) + 0.0)
            counts, chosen = [], []
            for i, hand in enumerate(hands):
                offered = _grasps(cell, hand, place.sides[i], place.leans[i], size)
                closed = _closed(cell, kernels[i], i, drawn[i], placed, offered, options)
                number = [len(q) for q in closed]
                counts.append(max(number))
                chosen.append(offered[int(np.argmax(number))])
            rank = sum(count > 0 for count in counts), min(counts)
            if rank > best:
                best, object_pose, grasps = rank, placed, chosen
            if min(counts) >= options.enough:
                break
        if best[0] == len(hands):
            break
    starts = []
    for i, grasp in enumerate(grasps):
        q = _drawn(cell, i, options.chosen_drawn)
        starts.append(_roomiest(cell, i, *_closed(cell, kernels[i], i, q, object_pose, [grasp])))
    return GraspedObject(object_pose, tuple(grasps), tuple(starts))


def _drawn(cell: Cell, i: int, count: int) -> Array:
    """Random postures of arm i within limits, (count, n)."""
    low, high = finite_range(cell.lower[i], cell.upper[i])
    return np.random.default_rng([0, i]).uniform(low, high, (count, len(low)))


def _grasps(cell: Cell, hand: Hand, side: Array, lean: Array, size: Array) -> list[Pose]:
    """Grasps at the face of a box on one side, the hand turned about its approach by quarters."""
    k, across = int(np.abs(side).argmax()), int(np.abs(lean).argmax())
    position = (size[k] / 2 / abs(side[k]) + hand.reach) * side + size[across] / 4 * lean
    position = np.round(position, 4) + 0.0
    grasps = []
    for quarter in range(4 if cell.problem.space.rigid else 1):
        turned = toward(hand, -side, quarter * np.pi / 2)
        grasps.append(Pose.make(position, turned.rotation, turned.quaternion))
    return grasps


def _closed(
    cell: Cell, kernels: ArmKernels, i: int, q: Array, object_pose: Pose, grasps: Sequence[Pose],
    quick: GraspOptions | None = None,
) -> list[Array]:  # fmt: skip
    """Postures of arm i that close, or with options for a quick count nearly, by grasp."""
    goals = []
    for grasp in grasps:
        tip = cell.arms[i].base.inverse() @ object_pose @ grasp
        goals.append(np.concatenate([tip.position, tip.quaternion]))
    lower, upper = cell.lower[i], cell.upper[i]
    many = np.tile(q, (len(goals), 1)), np.repeat(goals, len(q), axis=0), lower, upper
    if quick is None:
        near = CLOSED
        ends, gaps = project(kernels, *many)
    else:
        near = quick.near
        ends, gaps = project(kernels, *many, steps=quick.steps, closed=near)
    split = zip(np.split(ends, len(goals)), np.split(gaps, len(goals)), strict=True)
    return [end[gap < near] for end, gap in split]


def _roomiest(cell: Cell, i: int, q: Array) -> Array | None:
    """The posture, of (count, n), whose joints keep farthest from limits, in parts of their ranges.

    None where there are no postures.
    """
    if not len(q):
        return None
    q = cell.folded(i, q)
    low, high = finite_range(cell.lower[i], cell.upper[i])
    room = np.minimum(q - low, high - q) / (high - low)
    room = np.where(np.isfinite(cell.lower[i]) & np.isfinite(cell.upper[i]), room, 0.5)
    return np.asarray(q[int(room.min(axis=1).argmax())])
