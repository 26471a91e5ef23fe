"""Object and grasps that arms can close on: of many, those that leave the most postures."""

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

# Random postures that are closed at every place, and at the chosen one.
_FEW, _MANY = 48, 512
# So many of the few are enough for a place.
_ENOUGH = 30
# Steps in which a posture has to come so near, m or rad, to count at a place.
_STEPS, _NEAR = 20, 1e-6
# Turns of a hand about its approach: quarters, and where they do not do, eighths.
_QUARTERS, _EIGHTHS = 4, 8


@dataclass(frozen=True, eq=False)
class Holding:
    """An object, and how arms hold it.

    Attributes:
        object: T_world_object.
        grasps: T_object_tip by arm.
        starts: joints by arm, (n,); None of an arm that does not come to its grasp.
    """

    object: Pose
    grasps: tuple[Pose, ...]
    starts: tuple[Array | None, ...]


def choose(
    cell: Cell, kernels: Sequence[ArmKernels], hands: Sequence[Hand],
    groups: Sequence[Sequence[Place]], size: Array,
) -> Holding:  # fmt: skip
    """The place and the grasps at which the arm that closes least often does so most often; the
    first at which it does so often enough.

    Args:
        cell: with the arms on their bases.
        kernels: by arm.
        hands: alike.
        groups: where the object may be; of the first group in which all arms close.
        size: of the box that is held, m, (3,).
    """
    drawn = [_drawn(cell, i, _FEW) for i in range(len(cell.arms))]
    best: tuple[int, int] = (-1, -1)
    object_pose, grasps = Pose.from_rpy(), [Pose.from_rpy()] * len(hands)
    for group in groups:
        for place in group:
            here = Pose.from_rpy(np.round(place.position, 3) + 0.0)
            counts, chosen = [], []
            for i, hand in enumerate(hands):
                offered = _grasps(cell, hand, place.sides[i], place.leans[i], size)
                closed = _closed(cell, kernels[i], i, drawn[i], here, offered, _NEAR)
                number = [len(q) for q in closed]
                counts.append(max(number))
                chosen.append(offered[int(np.argmax(number))])
            rank = sum(count > 0 for count in counts), min(counts)
            if rank > best:
                best, object_pose, grasps = rank, here, chosen
            if min(counts) >= _ENOUGH:
                break
        if best[0] == len(hands):
            break
    starts = [
        _roomiest(cell, i, *_closed(cell, kernels[i], i, _drawn(cell, i, _MANY), object_pose, [at]))
        for i, at in enumerate(grasps)
    ]
    return Holding(object_pose, tuple(grasps), tuple(starts))


def _drawn(cell: Cell, i: int, count: int) -> Array:
    low, high = finite_range(cell.lower[i], cell.upper[i])
    return np.random.default_rng([0, i]).uniform(low, high, (count, len(low)))


def _grasps(cell: Cell, hand: Hand, side: Array, lean: Array, size: Array) -> list[Pose]:
    """Grasps at the face of a box on one side, the hand turned about its approach by quarters."""
    k, across = int(np.abs(side).argmax()), int(np.abs(lean).argmax())
    position = (size[k] / 2 / abs(side[k]) + hand.reach) * side + size[across] / 4 * lean
    position = np.round(position, 4) + 0.0
    found = []
    for quarter in range(4 if cell.problem.space.rigid else 1):
        turned = toward(hand, -side, quarter * np.pi / 2)
        found.append(Pose.make(position, turned.rotation, turned.quaternion))
    return found


def _closed(
    cell: Cell, kernels: ArmKernels, i: int, q: Array, object_pose: Pose, grasps: Sequence[Pose],
    near: float | None = None,
) -> list[Array]:  # fmt: skip
    """By grasp, the postures of arm i that random ones close to, or come so near to."""
    goals = []
    for grasp in grasps:
        tip = cell.arms[i].base.inverse() @ object_pose @ grasp
        goals.append(np.concatenate([tip.position, tip.quaternion]))
    lower, upper = cell.lower[i], cell.upper[i]
    many = np.tile(q, (len(goals), 1)), np.repeat(goals, len(q), axis=0), lower, upper
    if near is None:
        near = CLOSED
        ends, gaps = project(kernels, *many)
    else:
        ends, gaps = project(kernels, *many, steps=_STEPS, closed=near)
    split = zip(np.split(ends, len(goals)), np.split(gaps, len(goals)), strict=True)
    return [end[gap < near] for end, gap in split]


def _roomiest(cell: Cell, i: int, q: Array) -> Array | None:
    """Of postures, (count, n), that whose joints keep farthest from their limits, as parts of their
    ranges; None of none.
    """
    if not len(q):
        return None
    q = cell.folded(i, q)
    low, high = finite_range(cell.lower[i], cell.upper[i])
    room = np.minimum(q - low, high - q) / (high - low)
    room = np.where(np.isfinite(cell.lower[i]) & np.isfinite(cell.upper[i]), room, 0.5)
    return np.asarray(q[int(room.min(axis=1).argmax())])
