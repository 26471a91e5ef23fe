"""A posture as group states of an SRDF."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable

from copose.formats.postures import ExportedPosture, unique_names, xml_text


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
