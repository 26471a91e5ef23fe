"""A posture as keyframes of the MuJoCo models that its arms are."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

from copose.errors import InputError, arm_key
from copose.formats.markup import xml_text
from copose.formats.postures import ExportedPosture
from copose.loader import load
from copose.problem import Problem, RobotArm
from copose.results import Solution
from copose.robots import WholeRobot, load_arms, whole_robots


def keyframes_xml(exported: ExportedPosture) -> str:
    """A keyframe of every robot, ``qpos`` complete and in its model's own order.

    Hinges and slides stand where the posture has them, those that no arm moves where they are
    locked, follow another, or at 0. Free and ball joints stand as in the keyframe that arms start
    at, else as the model is written.

    Raises:
        InputError: the problem cannot be read or is not the result's, or a robot is no MuJoCo
            model.
    """
    solution = exported.solution
    problem = _problem(solution) if exported.problem is None else exported.problem
    for i, arm in enumerate(problem.arms):
        if not isinstance(arm, RobotArm) or arm.mjcf is None:
            raise InputError(
                "is no MuJoCo model; mujoco needs arms by mjcf",
                key=arm_key(i, arm.name),
                file=problem.source,
            )
    if {arm.name: arm.joint_names for arm in load_arms(problem)} != solution.joint_names:
        raise InputError("has other arms or joints than the result", file=problem.source)
    robots = whole_robots(problem)
    root = ET.Element("mujoco")
    keyframe = ET.SubElement(root, "keyframe")
    for robot in robots:
        arms = ", ".join(robot.arms)
        name = solution.problem.name if len(robots) == 1 else f"{solution.problem.name} {arms}"
        # A comment of XML holds no two hyphens.
        said = re.sub("-(?=-)", "- ", f" {robot.tree.file.name}: {arms} ")
        keyframe.append(ET.Comment(said))
        ET.SubElement(keyframe, "key", name=_unused(name, robot), qpos=_qpos(robot, exported))
    return xml_text(root)


def _problem(solution: Solution) -> Problem:
    file = solution.problem.file
    if file is None:
        raise InputError("names no problem file; mujoco needs the problem", key="problem.file")
    try:
        return load(file)
    except InputError as error:
        if str(error.file) != file:
            raise
        text = f"{error.message} (the result names this file; --problem names another)"
        raise InputError(text, key=error.key, file=file) from None


def _qpos(robot: WholeRobot, exported: ExportedPosture) -> str:
    qpos = robot.tree.qpos.copy()
    at = robot.positions(exported.posture.joints)
    for joint, address in robot.tree.addresses.items():
        qpos[address] = at[joint]
    return " ".join(map(repr, qpos.tolist()))


def _unused(name: str, robot: WholeRobot) -> str:
    """A name that no keyframe of the model has."""
    taken = {robot.tree.model.key(k).name for k in range(robot.tree.model.nkey)}
    while name in taken:
        name += "'"
    return name
