"""Bases of robots, places of the object, and grasps, by how many random postures close."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.cell.cell import Cell
from copose.collision.links.link_shapes import LinkShapes
from copose.poses import Array, Pose
from copose.robots import Arm, finite_range
from copose.robots.robot import Robot
from copose.self_motion.kernels import ArmKernels
from copose.self_motion.projection import CLOSED, project


@dataclass(frozen=True)
class LayoutOptions:
    """Distances of robots and objects, as parts of the shortest reach."""

    apart: float = 0.6  # of robots from the middle between them
    heights: tuple[float, ...] = (0.3, 0.0, 0.15, 0.5, -0.2, -0.4)  # over the shoulders, in turn
    ahead: tuple[float, ...] = (0.5, 0.4, 0.6, 0.3, 0.7)  # in front of the shoulders of one robot
    levels: tuple[float, ...] = (-0.2, 0.0, -0.4, 0.2)  # over the shoulders of one robot
    above: float = 0.15  # over the root of an arm by itself: height that is above its table
    telling: float = 0.1  # length of the mean way to the tip that tells where the front is


@dataclass(frozen=True, eq=False)
class Reach:
    """The reach of an arm in its robot's root frame."""

    shoulder: Array  # origin of its first joint, m, (3,)
    length: float  # largest distance of the tip from there, m
    mean: Array  # mean displacement of the tip from there, m, (3,)

    @classmethod
    def of(cls, arm: Arm, postures: int = 200) -> Reach:
        """The reach over random postures, with the arm's base in its robot's root frame."""
        shoulder = arm.frames(np.zeros(arm.n))[1].position
        low, high = finite_range(arm.lower, arm.upper)
        drawn = np.random.default_rng(0).uniform(low, high, (postures, arm.n))
        tips = np.array([arm.frames(q)[-1].position for q in drawn])
        ways = tips - shoulder
        return cls(shoulder, float(np.linalg.norm(ways, axis=1).max()), ways.mean(axis=0))


@dataclass(frozen=True, eq=False)
class Place:
    """A place of the object, and the sides from which arms approach it."""

    position: Array  # of the object, m, (3,)
    sides: tuple[Array, ...]  # by arm, the direction from the object to the side that the arm takes
    # By arm, the direction on that side in which it stays off its middle; zero of one that has it
    # for itself.
    leans: tuple[Array, ...]


def bases(reaches: Sequence[Sequence[Reach]]) -> list[Pose]:
    """Bases by robot: the first at the origin, all of them facing the middle between them."""
    if len(reaches) == 1:
        return [Pose.from_rpy()]
    middle = np.array([_distance(reaches[0]), 0.0, 0.0])
    poses = []
    for k, arm_reaches in enumerate(reaches):
        angle = 2 * np.pi * k / len(reaches)
        x, y, _ = forward(arm_reaches, LayoutOptions.telling)
        turn = np.pi - np.mod(np.pi - angle + np.arctan2(y, x), 2 * np.pi)
        ahead = np.array([np.cos(angle), np.sin(angle), 0.0])
        position = np.round(middle - _distance(arm_reaches) * ahead, 3) + 0.0
        poses.append(Pose.from_rpy(position, (0.0, 0.0, turn)))
    return poses


def forward(reaches: Sequence[Reach], telling: float = LayoutOptions.telling) -> Array:
    """The front of a robot, one of ±x, ±y of its root frame, (3,): x unless its arms tell: their
    mean way to the tips is such a part of the shortest reach at least.
    """
    across = np.ones(3)
    if len(reaches) > 1:
        spread = np.abs(np.ptp([reach.shoulder for reach in reaches], axis=0))
        across = (spread < spread[:2].max()).astype(float)
    way = np.mean([reach.mean for reach in reaches], axis=0) * across * [1, 1, 0]
    k = int(np.abs(way).argmax())
    least = telling * min(reach.length for reach in reaches)
    ahead = np.zeros(3)
    if abs(way[k]) > least:
        ahead[k] = np.sign(way[k])
    else:
        ahead[0 if across[0] else 1] = 1.0
    return ahead


def _distance(reaches: Sequence[Reach]) -> float:
    """Distance of a robot's base from the middle, m, by its shoulders where it has several arms."""
    length = min(reach.length for reach in reaches)
    shoulders = np.mean([reach.shoulder for reach in reaches], axis=0)
    ahead = float(shoulders @ forward(reaches, LayoutOptions.telling)) if len(reaches) > 1 else 0.0
    return round(LayoutOptions.apart * length + ahead, 2)


def places(stands: Sequence[Pose], reaches: Sequence[Sequence[Reach]]) -> list[list[Place]]:
    """Places of the object in groups, each for arms that close nowhere in the group before."""
    shoulders = [
        [stand.rotation @ reach.shoulder + stand.position for reach in arm_reaches]
        for stand, arm_reaches in zip(stands, reaches, strict=True)
    ]
    all_shoulders = np.array([shoulder for robot in shoulders for shoulder in robot])
    shortest = min(reach.length for robot in reaches for reach in robot)
    middle = all_shoulders.mean(axis=0)
    if len(stands) == 1:
        front = forward(reaches[0], LayoutOptions.telling)
        return _in_front(middle, all_shoulders, shortest, front)
    ahead = stands[0].rotation @ forward(reaches[0], LayoutOptions.telling)
    center = ahead * _distance(reaches[0])
    up, backs, sides, leans = np.array([0.0, 0.0, 1.0]), [], [], []
    for stand, robot in zip(stands, shoulders, strict=True):
        back = (stand.position - center) * [1, 1, 0]
        back /= np.linalg.norm(back)
        alone = len(robot) == 1
        backs += [back] * len(robot)
        sides += [back if alone else _side(shoulder, robot) for shoulder in robot]
        leans += [np.zeros(3) if alone else back] * len(robot)
    heights = [
        np.array([*center[:2], middle[2] + height * shortest]) for height in LayoutOptions.heights
    ]
    return [
        [Place(position, tuple(sides), tuple(leans)) for position in heights],
        [Place(position, (up,) * len(all_shoulders), tuple(backs)) for position in heights],
    ]


def _in_front(middle: Array, shoulders: Array, shortest: float, ahead: Array) -> list[list[Place]]:
    """Places in front of one robot, and last of all behind it.

    Its arms come from both sides, or side by side from their own; one arm alone comes from its own
    side, or from above.
    """
    up = np.array([0.0, 0.0, 1.0])
    lateral = tuple(_side(shoulder, shoulders) for shoulder in shoulders)
    none, alone = (np.zeros(3),) * len(shoulders), len(shoulders) == 1
    # An arm by itself most often stands on a table, at whose height its root is.
    low = LayoutOptions.above * shortest if alone else -np.inf
    groups = []
    for front in (ahead, -ahead):
        where = [
            middle + shortest * (far * front + level * up)
            for level in LayoutOptions.levels
            for far in LayoutOptions.ahead
        ]
        heights = [[at for at in where if (at[2] < low) == under] for under in (False, True)]
        near = (-front,) * len(shoulders)
        ways = [(near, none), ((up,), none)] if alone else [(lateral, none), (near, lateral)]
        groups += [
            [Place(at, sides, leans) for at in positions]
            for positions in heights if positions for sides, leans in ways
        ]  # fmt: skip
    return groups


def _side(shoulder: Array, shoulders: Sequence[Array] | Array) -> Array:
    """The level direction of the side of an object in front of a robot that an arm takes, (3,)."""
    lateral = np.asarray(shoulder) - np.mean(shoulders, axis=0)
    lateral[2] = 0.0
    size = float(np.linalg.norm(lateral))
    return lateral / size if size > 1e-6 else np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True, eq=False)
class Hand:
    """The approach axis and the reach of a hand."""

    axis: Array  # of the tip's frame, (3,): one of ±x, ±y, ±z
    reach: float  # from the tip to the ends of the fingers along it, m
    guess: bool  # whether nothing said so

    @property
    def name(self) -> str:
        """The approach axis in words."""
        k = int(np.abs(self.axis).argmax())
        return ("−" if self.axis[k] < 0 else "+") + "xyz"[k]

    @classmethod
    def of(cls, robot: Robot, shapes: LinkShapes, arm: Arm, locked: dict[str, float]) -> Hand:
        """The hand of an arm, by its wrist, its shapes and its tip, with joints that are held by
        name.
        """
        longest = 0.25  # reach of a hand, m
        no_way = 0.01  # distance that shows no direction, m
        names = arm.joint_names
        placed = robot.tree.placed(robot.tree.standing(locked, names).at, names)
        points = [np.zeros((0, 3))]
        for link, parts in shapes.parts.items():
            carrier, pose = placed[link]
            if carrier != names[-1]:
                continue
            for part in parts:
                corners, radius = part.shape.hull
                at = pose @ part.placement
                corners = corners @ at.rotation.T + at.position
                points += [corners + radius * np.eye(3)[k] * s for k in range(3) for s in (1, -1)]
        to_tip = arm.tip.inverse()
        hand = np.vstack(points) @ to_tip.rotation.T + to_tip.position
        wrist = to_tip.position
        middle = (hand.min(axis=0) + hand.max(axis=0)) / 2 if len(hand) else wrist
        way = middle - 2 * wrist
        if float(np.linalg.norm(wrist)) < no_way:
            # Flanges bear the last joint's own origin: they face along its axis, away from the
            # joint before, or where that is level with it, to where the hand is.
            spin = to_tip.rotation @ arm.joints[-1].axis
            before = (to_tip @ arm.joints[-1].placement.inverse()).position
            ahead = -float(before @ spin) if len(arm.joints) > 1 else 0.0
            way = spin * (ahead if abs(ahead) > no_way else float(middle @ spin))
        k = int(np.abs(way).argmax())
        axis = np.zeros(3)
        axis[k] = np.sign(way[k])
        guess = abs(way[k]) < no_way
        if guess:
            axis = np.array([0.0, 0.0, 1.0])
        reach = float((hand @ axis).max()) if len(hand) else 0.0
        return cls(axis, round(min(max(reach, 0.0), longest), 3), guess)


def toward(hand: Hand, direction: Array, roll: float) -> Pose:
    """A frame whose approach axis points along a direction, turned about it by a roll, rad.

    At roll 0 the next axis of the tip is as level as it can be.
    """
    k = int(np.abs(hand.axis).argmax())
    ahead = direction / np.linalg.norm(direction) * hand.axis[k]
    up = np.array([0.0, 0.0, 1.0]) if abs(direction[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    level = np.cross(up, ahead)
    level /= np.linalg.norm(level)
    level = np.cos(roll) * level + np.sin(roll) * np.cross(ahead, level)
    columns = np.zeros((3, 3))
    columns[:, k], columns[:, (k + 1) % 3] = ahead, level
    columns[:, (k + 2) % 3] = np.cross(ahead, level)
    return Pose.from_rotation(columns)


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
