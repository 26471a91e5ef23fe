"""The arms of a problem."""

from __future__ import annotations

from pathlib import Path

from copose.errors import InputError
from copose.problem import PlanarArm, Problem, UrdfArm
from copose.robots.arm import Arm
from copose.robots.planar import planar_arm


def load_arms(problem: Problem) -> tuple[Arm, ...]:
    """Read every arm of a problem into plain numbers, in file order.

    Raises:
        InputError: a robot cannot be read, has fewer free joints than the task needs, a margin
            that eats a joint's range, or two arms that do not move independently.
    """
    try:
        arms = _load(problem)
        for i, arm in enumerate(arms):
            _check(arm, problem, f"arms[{i}]")
    except InputError as error:
        raise InputError(error.message, key=error.key, file=problem.source) from None
    return arms


def _load(problem: Problem) -> tuple[Arm, ...]:
    planar = [spec for spec in problem.arms if isinstance(spec, PlanarArm)]
    if planar:
        return tuple(planar_arm(spec, f"arms[{i}]") for i, spec in enumerate(planar))
    # Pinocchio takes a quarter of a second to load, which planar problems need not wait for.
    from copose.robots.urdf import Robot, RobotOnBase, read_robot, urdf_arm

    folder = problem.source.parent if problem.source is not None else Path()
    read: dict[Path, Robot] = {}
    arms: list[Arm] = []
    robots: list[RobotOnBase] = []
    for i, spec in enumerate(spec for spec in problem.arms if isinstance(spec, UrdfArm)):
        key = f"arms[{i}]"
        arm, robot = urdf_arm(spec, read_robot(spec, folder, key, read), key)
        for other, its_robot in zip(arms, robots, strict=True):
            joint = robot.clash(its_robot)
            if joint is not None:
                raise InputError(
                    f"arms {other.name!r} and {arm.name!r} are one robot and both hang on joint "
                    f"{joint!r}; lock it in both, so that the arms are independent",
                    key=f"{key}.locked",
                )
            if robot.same(its_robot) and "base" in (*arm.free, *other.free):
                raise InputError(
                    f"arms {other.name!r} and {arm.name!r} are one robot, whose base cannot be "
                    "moved for one of them; let the object move instead",
                    key=f"{key}.freedom.base",
                )
        arms.append(arm)
        robots.append(robot)
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
