"""A posture as XML: group states of an SRDF, keyframes of MuJoCo models."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable

import numpy as np

from copose.errors import InputError, arm_key
from copose.formats.postures import ExportedPosture, problem_of, unique_names, xml_text
from copose.poses import Array
from copose.problem import RobotArm
from copose.results import Posture
from copose.robots import Arm
from copose.robots.whole_robot import WholeRobot, whole_robots


def group_state_srdf(exported: ExportedPosture) -> str:
    """Groups of the arms' joints and, each called as the problem, their states.

    The first state is that of all arms: of states of one name Pinocchio reads the first.

    Raises:
        InputError: two joints would have one name, or a name is none in XML.
    """
    title = exported.solution.problem.name
    names = unique_names(exported.solution.joint_names)
    joints = {
        arm: list(zip(names[arm], exported.posture.joints[arm], strict=True)) for arm in names
    }
    robot = ET.Element("robot", name=title)
    for arm, own in joints.items():
        group = ET.SubElement(robot, "group", name=arm)
        for joint, _ in own:
            ET.SubElement(group, "joint", name=joint)
    if len(joints) > 1:
        together = "_and_".join(joints)
        group = ET.SubElement(robot, "group", name=together)
        for arm in joints:
            ET.SubElement(group, "group", name=arm)
        _state(robot, title, together, (pair for own in joints.values() for pair in own))
    for arm, own in joints.items():
        _state(robot, title, arm, own)
    return xml_text(robot)


def _state(robot: ET.Element, title: str, group: str, joints: Iterable[tuple[str, float]]) -> None:
    state = ET.SubElement(robot, "group_state", name=title, group=group)
    for joint, position in joints:
        ET.SubElement(state, "joint", name=joint, value=repr(position))


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
    problem = problem_of(solution, exported.problem, "mujoco")
    for i, spec in enumerate(problem.arms):
        if not isinstance(spec, RobotArm) or spec.mjcf is None:
            raise InputError(
                "is no MuJoCo model; mujoco needs arms by mjcf",
                key=arm_key(i, spec.name),
                file=problem.source,
            )
    robots = whole_robots(problem)
    arms = [arm for robot in robots for arm in robot.arms]
    if {arm.name: arm.joint_names for arm in arms} != solution.joint_names:
        raise InputError("has other arms or joints than the result", file=problem.source)
    for arm in arms:
        if not _agrees(arm, exported.posture):
            raise InputError(
                f"has arm {arm.name!r} stand otherwise than the result; give the problem as it "
                "was solved, with what --set changed",
                file=problem.source,
            )
    root = ET.Element("mujoco")
    keyframe = ET.SubElement(root, "keyframe")
    for robot in robots:
        names = ", ".join(arm.name for arm in robot.arms)
        name = solution.problem.name if len(robots) == 1 else f"{solution.problem.name} {names}"
        # A comment of XML holds no two hyphens.
        comment = re.sub("-(?=-)", "- ", f" {robot.tree.file.name}: {names} ")
        keyframe.append(ET.Comment(comment))
        ET.SubElement(keyframe, "key", name=_unused(name, robot), qpos=_qpos(robot, exported))
    return xml_text(root)


def _agrees(arm: Arm, posture: Posture) -> bool:
    """True for an arm whose frames are as far apart as in a posture, wherever its base is."""
    frames = arm.frames(posture.joints[arm.name])
    own = np.array([frame.position for frame in frames])
    stated = np.array(posture.arms[arm.name].skeleton)
    # To 1e-6 m.
    return own.shape == stated.shape and np.allclose(_spans(own), _spans(stated), 0, 1e-6)


def _spans(points: Array) -> Array:
    """Distances between points, (k, k)."""
    return np.asarray(np.linalg.norm(points[:, None] - points, axis=2))


def _qpos(robot: WholeRobot, exported: ExportedPosture) -> str:
    """All positions of a robot's model, in the model's order."""
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
