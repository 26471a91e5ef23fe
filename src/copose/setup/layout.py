"""Where robots stand, and where the object may be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.poses import Array, Pose
from copose.robots import Arm, finite_range

# Bases stand at this part of their common reach.
APART = 0.6
# Random postures from which a reach is told.
_POSTURES = 200
# Where the object may be: height over the shoulders and distance in front of them, as parts of the
# shortest reach.
_HEIGHTS = (0.3, 0.0, 0.15, 0.5, -0.2, -0.4)
_AHEAD = (0.5, 0.4, 0.6, 0.3, 0.7)
# What counts as above the table that an arm by itself stands on, alike.
_ABOVE = 0.15
_LEVELS = (-0.2, 0.0, -0.4, 0.2)
_UP, _NOWHERE = np.array([0.0, 0.0, 1.0]), np.zeros(3)
# A mean way that tells where a robot's front is, as a part of its reach.
_TELLING = 0.1


@dataclass(frozen=True, eq=False)
class Reach:
    """Where an arm's tip comes, in its robot's root frame.

    Attributes:
        shoulder: origin of its first joint, m, (3,).
        length: how far the tip comes from there, m.
        mean: of the way from there to the tip, m, (3,).
    """

    shoulder: Array
    length: float
    mean: Array

    @classmethod
    def of(cls, arm: Arm) -> Reach:
        """From random postures, the arm standing where its robot's root is the world."""
        shoulder = arm.frames(np.zeros(arm.n))[1].position
        low, high = finite_range(arm.lower, arm.upper)
        drawn = np.random.default_rng(0).uniform(low, high, (_POSTURES, arm.n))
        tips = np.array([arm.frames(q)[-1].position for q in drawn])
        ways = tips - shoulder
        return cls(shoulder, float(np.linalg.norm(ways, axis=1).max()), ways.mean(axis=0))


@dataclass(frozen=True, eq=False)
class Place:
    """Where an object may be, and how arms come to it.

    Attributes:
        position: of the object, m, (3,).
        sides: by arm, the direction from the object to the side that the arm takes.
        leans: by arm, the direction on that side in which it stays off its middle; zero of one
            that has it for itself.
    """

    position: Array
    sides: tuple[Array, ...]
    leans: tuple[Array, ...]


def bases(reaches: Sequence[Sequence[Reach]]) -> list[Pose]:
    """Where robots stand, by robot: the first at the origin, facing the others across a middle that
    each is 0.6 of its reach away from.
    """
    if len(reaches) == 1:
        return [Pose.from_rpy()]
    middle = np.array([_distance(reaches[0]), 0.0, 0.0])
    found = []
    for k, mine in enumerate(reaches):
        angle = 2 * np.pi * k / len(reaches)
        x, y, _ = forward(mine)
        turn = np.pi - np.mod(np.pi - angle + np.arctan2(y, x), 2 * np.pi)
        ahead = np.array([np.cos(angle), np.sin(angle), 0.0])
        position = np.round(middle - _distance(mine) * ahead, 3) + 0.0
        found.append(Pose.from_rpy(position, (0.0, 0.0, turn)))
    return found


def forward(reaches: Sequence[Reach]) -> Array:
    """Which of ±x, ±y of its root frame a robot works towards, (3,): x unless its arms tell."""
    across = np.ones(3)
    if len(reaches) > 1:
        spread = np.abs(np.ptp([reach.shoulder for reach in reaches], axis=0))
        across = (spread < spread[:2].max()).astype(float)
    way = np.mean([reach.mean for reach in reaches], axis=0) * across * [1, 1, 0]
    k = int(np.abs(way).argmax())
    least = _TELLING * min(reach.length for reach in reaches)
    ahead = np.zeros(3)
    if abs(way[k]) > least:
        ahead[k] = np.sign(way[k])
    else:
        ahead[0 if across[0] else 1] = 1.0
    return ahead


def _distance(reaches: Sequence[Reach]) -> float:
    """From a robot's base to the middle, m; with several arms its shoulders count, not its base."""
    length = min(reach.length for reach in reaches)
    shoulders = np.mean([reach.shoulder for reach in reaches], axis=0)
    ahead = float(shoulders @ forward(reaches)) if len(reaches) > 1 else 0.0
    return round(APART * length + ahead, 2)


def places(stands: Sequence[Pose], reaches: Sequence[Sequence[Reach]]) -> list[list[Place]]:
    """Where the object may be, in groups: the next is for arms that close nowhere in one.

    Args:
        stands: T_world_root by robot.
        reaches: of its arms, by robot.
    """
    shoulders = [
        [stand.rotation @ reach.shoulder + stand.position for reach in mine]
        for stand, mine in zip(stands, reaches, strict=True)
    ]
    every = np.array([shoulder for mine in shoulders for shoulder in mine])
    shortest = min(reach.length for mine in reaches for reach in mine)
    middle = every.mean(axis=0)
    if len(stands) == 1:
        return _in_front(middle, every, shortest, forward(reaches[0]))
    center = stands[0].rotation @ forward(reaches[0]) * _distance(reaches[0])
    backs, sides, leans = [], [], []
    for stand, mine in zip(stands, shoulders, strict=True):
        back = (stand.position - center) * [1, 1, 0]
        back /= np.linalg.norm(back)
        alone = len(mine) == 1
        backs += [back] * len(mine)
        sides += [back if alone else _beside(shoulder, mine) for shoulder in mine]
        leans += [_NOWHERE if alone else back] * len(mine)
    heights = [np.array([*center[:2], middle[2] + height * shortest]) for height in _HEIGHTS]
    return [
        [Place(position, tuple(sides), tuple(leans)) for position in heights],
        [Place(position, (_UP,) * len(every), tuple(backs)) for position in heights],
    ]


def _in_front(middle: Array, shoulders: Array, shortest: float, ahead: Array) -> list[list[Place]]:
    """Places of one robot: its arms come from both sides, or side by side from their own; one arm
    alone from its own side, or from above. Last of all behind it.
    """
    lateral = tuple(_beside(shoulder, shoulders) for shoulder in shoulders)
    none, alone = (_NOWHERE,) * len(shoulders), len(shoulders) == 1
    # An arm by itself most often stands on a table, at whose height its root is.
    low = _ABOVE * shortest if alone else -np.inf
    groups = []
    for front in (ahead, -ahead):
        where = [
            middle + shortest * (far * front + level * _UP) for level in _LEVELS for far in _AHEAD
        ]
        heights = [[at for at in where if (at[2] < low) == under] for under in (False, True)]
        near = (-front,) * len(shoulders)
        ways = [(near, none), ((_UP,), none)] if alone else [(lateral, none), (near, lateral)]
        groups += [
            [Place(at, sides, leans) for at in some]
            for some in heights if some for sides, leans in ways
        ]  # fmt: skip
    return groups


def _beside(shoulder: Array, shoulders: Sequence[Array] | Array) -> Array:
    """The side of an object in front of a robot that an arm takes, level."""
    lateral = np.asarray(shoulder) - np.mean(shoulders, axis=0)
    lateral[2] = 0.0
    size = float(np.linalg.norm(lateral))
    return lateral / size if size > 1e-6 else np.array([0.0, 1.0, 0.0])
