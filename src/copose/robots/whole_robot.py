"""The robots of a spatial problem, each read once, and the arms that are parts of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from copose.errors import InputError, arm_key, blamed_on
from copose.problem import Problem, RobotArm
from copose.robots.arm import Arm
from copose.robots.chain_arm import robot_arm
from copose.robots.files.tree import Tree
from copose.robots.robot import RobotOnBase, RobotsRead, read_robot
from copose.selection import groups


@dataclass(frozen=True, eq=False)
class WholeRobot:
    """A robot with all arms that are parts of it."""

    tree: Tree  # its links and joints
    arms: tuple[Arm, ...]  # in the order of the problem
    locked: Mapping[str, float]  # joints that any of the arms' tables holds, rad or m

    def positions(self, joints: Mapping[str, Sequence[float]]) -> dict[str, float]:
        """Positions of all movable joints of the robot, rad or m, by those of its arms."""
        moved = {
            name: position
            for arm in self.arms
            for name, position in zip(arm.joint_names, joints[arm.name], strict=True)
        }
        return dict(self.tree.standing({**self.locked, **moved}).at)


def whole_robots(problem: Problem) -> tuple[WholeRobot, ...]:
    """The robots of a spatial problem, in the order of their first arms.

    Raises:
        InputError: a robot cannot be read, or two arms do not move independently.
    """
    with blamed_on(problem.source):
        parts = robot_parts(problem)
    return tuple(
        WholeRobot(
            tree=team[0].tree,
            arms=tuple(part.arm for part in team),
            locked={name: at for part in team for name, at in part.spec.locked.items()},
        )
        for team in groups(parts, lambda first, part: first.whole.same(part.whole))
    )


@dataclass(frozen=True, eq=False)
class RobotPart:
    """An arm with its table, and the robot that it is part of."""

    spec: RobotArm
    arm: Arm
    tree: Tree
    whole: RobotOnBase


def robot_parts(problem: Problem) -> list[RobotPart]:
    """The arms of a spatial problem, each robot's file read once."""
    folder = problem.source.parent if problem.source is not None else Path()
    read: RobotsRead = {}
    parts: list[RobotPart] = []
    for i, spec in enumerate(spec for spec in problem.arms if isinstance(spec, RobotArm)):
        key = arm_key(i, spec.name)
        robot = read_robot(spec, folder, key, read)
        arm, whole = robot_arm(spec, robot, key, weighed=not problem.kinematic)
        for part in parts:
            other = part.arm
            clash = whole.clash(part.whole)
            if clash is not None:
                raise InputError(
                    f"arms {other.name!r} and {arm.name!r} are one robot and {clash}",
                    key=f"{key}.locked",
                )
            if whole.same(part.whole) and "base" in (*arm.free, *other.free):
                raise InputError(
                    f"arms {other.name!r} and {arm.name!r} are one robot, whose base cannot be "
                    "moved for one of them; let the object move instead",
                    key=f"{key}.freedom.base",
                )
        parts.append(RobotPart(spec, arm, robot.tree, whole))
    return parts
