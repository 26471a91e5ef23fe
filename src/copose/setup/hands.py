"""Hands: their approach axis, and their reach beyond the frame that grasps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.collision.links.link_shapes import LinkShapes
from copose.poses import Array, Pose
from copose.robots import Arm
from copose.robots.robot import Robot


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
        """The hand of an arm, by its wrist, its shapes and its tip.

        Args:
            robot: the robot.
            shapes: of its links.
            arm: in the robot.
            locked: positions of joints that are held, by name.
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
