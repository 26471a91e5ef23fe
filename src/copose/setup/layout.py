"""Layout of a cell: bases of robots, and places of the object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.poses import Array, Pose
from copose.robots import Arm, finite_range


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


def bases(
    reaches: Sequence[Sequence[Reach]], options: LayoutOptions = LayoutOptions()
) -> list[Pose]:
    """Bases by robot: the first at the origin, all of them facing the middle between them."""
    if len(reaches) == 1:
        return [Pose.from_rpy()]
    middle = np.array([_distance(reaches[0], options), 0.0, 0.0])
    poses = []
    for k, arm_reaches in enumerate(reaches):
        angle = 2 * np.pi * k / len(reaches)
        x, y, _ = forward(arm_reaches, options.telling)
        turn = np.pi - np.mod(np.pi - angle + np.arctan2(y, x), 2 * np.pi)
        ahead = np.array([np.cos(angle), np.sin(angle), 0.0])
        position = np.round(middle - _distance(arm_reaches, options) * ahead, 3) + 0.0
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


def _distance(reaches: Sequence[Reach], options: LayoutOptions) -> float:
    """Distance of a robot's base from the middle, m, by its shoulders where it has several arms."""
    length = min(reach.length for reach in reaches)
    shoulders = np.mean([reach.shoulder for reach in reaches], axis=0)
    ahead = float(shoulders @ forward(reaches, options.telling)) if len(reaches) > 1 else 0.0
    return round(options.apart * length + ahead, 2)


def places(
    stands: Sequence[Pose],
    reaches: Sequence[Sequence[Reach]],
    options: LayoutOptions = LayoutOptions(),
) -> list[list[Place]]:
    """Places of the object in groups, each for arms that close nowhere in the group before."""
    shoulders = [
        [stand.rotation @ reach.shoulder + stand.position for reach in arm_reaches]
        for stand, arm_reaches in zip(stands, reaches, strict=True)
    ]
    all_shoulders = np.array([shoulder for robot in shoulders for shoulder in robot])
    shortest = min(reach.length for robot in reaches for reach in robot)
    middle = all_shoulders.mean(axis=0)
    if len(stands) == 1:
        front = forward(reaches[0], options.telling)
        return _in_front(middle, all_shoulders, shortest, front, options)
    ahead = stands[0].rotation @ forward(reaches[0], options.telling)
    center = ahead * _distance(reaches[0], options)
    up, backs, sides, leans = np.array([0.0, 0.0, 1.0]), [], [], []
    for stand, robot in zip(stands, shoulders, strict=True):
        back = (stand.position - center) * [1, 1, 0]
        back /= np.linalg.norm(back)
        alone = len(robot) == 1
        backs += [back] * len(robot)
        sides += [back if alone else _side(shoulder, robot) for shoulder in robot]
        leans += [np.zeros(3) if alone else back] * len(robot)
    heights = [np.array([*center[:2], middle[2] + height * shortest]) for height in options.heights]
    return [
        [Place(position, tuple(sides), tuple(leans)) for position in heights],
        [Place(position, (up,) * len(all_shoulders), tuple(backs)) for position in heights],
    ]


def _in_front(
    middle: Array, shoulders: Array, shortest: float, ahead: Array, options: LayoutOptions
) -> list[list[Place]]:
    """Places in front of one robot, and last of all behind it.

    Its arms come from both sides, or side by side from their own; one arm alone comes from its own
    side, or from above.
    """
    up = np.array([0.0, 0.0, 1.0])
    lateral = tuple(_side(shoulder, shoulders) for shoulder in shoulders)
    none, alone = (np.zeros(3),) * len(shoulders), len(shoulders) == 1
    # An arm by itself most often stands on a table, at whose height its root is.
    low = options.above * shortest if alone else -np.inf
    groups = []
    for front in (ahead, -ahead):
        where = [
            middle + shortest * (far * front + level * up)
            for level in options.levels
            for far in options.ahead
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
