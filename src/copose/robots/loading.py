"""The arms of a problem."""

from __future__ import annotations

from pathlib import Path

from copose.errors import InputError, arm_key
from copose.problem import PlanarArm, Problem, RobotArm
from copose.robots.arm import Arm
from copose.robots.planar import planar_arm
from copose.robots.robot import RobotOnBase, RobotsRead, read_robot, robot_arm


def load_arms(problem: Problem) -> tuple[Arm, ...]:
    """Read every arm of a problem into plain numbers, in file order.

    Raises:
        InputError: a robot cannot be read, has fewer free joints than the task needs, a margin
            that eats a joint's range, or two arms that do not move independently.
    """
    try:
        arms = _load(problem)
        for i, arm in enumerate(arms):
            _check(arm, problem, arm_key(i, arm.name))
    except InputError as error:
        raise InputError(error.message, key=error.key, file=problem.source) from None
    return arms


def _load(problem: Problem) -> tuple[Arm, ...]:
    planar = [spec for spec in problem.arms if isinstance(spec, PlanarArm)]
    if planar:
        return tuple(planar_arm(spec, arm_key(i, spec.name)) for i, spec in enumerate(planar))
    folder = problem.source.parent if problem.source is not None else Path()
    read: RobotsRead = {}
    arms: list[Arm] = []
    robots: list[RobotOnBase] = []
    for i, spec in enumerate(spec for spec in problem.arms if isinstance(spec, RobotArm)):
        key = arm_key(i, spec.name)
        robot = read_robot(spec, folder, key, read)
        arm, whole = robot_arm(spec, robot, key, weighed=not problem.kinematic)
        for other, its_whole in zip(arms, robots, strict=True):
            clash = whole.clash(its_whole)
            if clash is not None:
                raise InputError(
                    f"arms {other.name!r} and {arm.name!r} are one robot and {clash}",
                    key=f"{key}.locked",
                )
            if whole.same(its_whole) and "base" in (*arm.free, *other.free):
                raise InputError(
                    f"arms {other.name!r} and {arm.name!r} are one robot, whose base cannot be "
                    "moved for one of them; let the object move instead",
                    key=f"{key}.freedom.base",
                )
        arms.append(arm)
        robots.append(whole)
    return tuple(arms)


def _check(arm: Arm, problem: Problem, key: str) -> None:
    space, margin = problem.space, problem.constraints.joint_margin
    if arm.n < space.m:
        raise InputError(
            f"has {arm.n} free joints ({', '.join(arm.joint_names)}); space "
            f"{space.name!r} needs at least {space.m}",
            key=key,
        )
    for joint in arm.joints:
        if joint.lower + margin >= joint.upper - margin:
            raise InputError(
                f"{margin:g} leaves nothing of the range of joint {joint.name!r} of arm "
                f"{arm.name!r} ({joint.lower:g} … {joint.upper:g})",
                key="constraints.joint_margin",
            )
