"""A URDF's tree of links as names, read before Pinocchio so that faults can be named."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

from copose.errors import InputError, nearest
from copose.problem import read_text

MOVABLE = ("revolute", "continuous", "prismatic")
_MOST_BYTES = 50_000_000
_MOST_JOINTS = 2_000


@dataclass(frozen=True)
class TreeJoint:
    """A joint of the tree and what its XML says of limits."""

    name: str
    kind: str
    parent: str
    child: str
    mimics: str | None
    has_effort: bool
    has_velocity: bool


@dataclass(frozen=True)
class Tree:
    """Links and joints of a URDF.

    Attributes:
        xml: the robot, its links called ``link:…`` and its joints ``joint:…``: in a URDF a link and
            a joint may share a name, among Pinocchio's frames they may not.
        file: where it was read.
        links: link names and whether each has inertials.
        joints: by the name of their child link.
    """

    xml: str
    file: Path
    links: dict[str, bool]
    joints: dict[str, TreeJoint]

    @property
    def root(self) -> str:
        """The link that no joint moves."""
        return next(link for link in self.links if link not in self.joints)

    @property
    def movable(self) -> dict[str, TreeJoint]:
        """Joints of one degree of freedom, by name."""
        return {j.name: j for j in self.joints.values() if j.kind in MOVABLE}

    def ancestors(self, link: str) -> list[TreeJoint]:
        """The joints between the URDF's root link and a link, nearest the link first."""
        path = []
        while link in self.joints:
            path.append(self.joints[link])
            link = self.joints[link].parent
        return path

    def chain(self, root: str, tip: str) -> list[TreeJoint]:
        """The joints from root to tip.

        Raises:
            InputError: unknown links, or a root that is not above the tip; key says which.
        """
        for key, link in (("tip", tip), ("root", root)):
            if link not in self.links:
                raise InputError(
                    f"{link!r} is no link of {self.file.name}{nearest(link, self.links)}", key=key
                )
        path: list[TreeJoint] = []
        for joint in self.ancestors(tip):
            path.insert(0, joint)
            if joint.parent == root:
                return path
        if root == tip:
            return []
        raise InputError(
            f"{root!r} is not above the tip {tip!r}; above it are "
            + ", ".join(joint.parent for joint in self.ancestors(tip)),
            key="root",
        )


def read_tree(file: Path) -> Tree:
    """Read a URDF's tree.

    Raises:
        InputError: no such file, xacro, broken XML, or no tree of links.
    """
    if file.suffix == ".xacro":
        raise _is_xacro(file)
    text = read_text(file, _MOST_BYTES)
    try:
        robot = ET.fromstring(text.encode())
    except (ET.ParseError, ValueError) as error:
        raise InputError(f"{file.name} is not XML: {error}") from None
    if robot.tag != "robot":
        raise InputError(f"{file.name} is not a URDF: its root is <{robot.tag}>, not <robot>")
    for element in robot.iter():
        if isinstance(element.tag, str) and "xacro" in element.tag.partition("}")[0]:
            raise _is_xacro(file)
    if not robot.get("name"):
        raise InputError(f"{file.name} is not a URDF: <robot> has no name")
    links: dict[str, bool] = {}
    for element in robot.findall("link"):
        name = element.get("name", "")
        if not name or name in links:
            raise InputError(f"{file.name} is broken: link {name!r} has no name or appears twice")
        links[name] = element.find("inertial") is not None
    joints: dict[str, TreeJoint] = {}
    names: set[str] = set()
    elements = robot.findall("joint")
    if len(elements) > _MOST_JOINTS:
        raise InputError(f"{file.name} has {len(elements)} joints; at most {_MOST_JOINTS} are read")
    for element in elements:
        joint = _joint(element, file)
        for link in (joint.parent, joint.child):
            if link not in links:
                raise InputError(
                    f"{file.name} is broken: joint {joint.name!r} names the link {link!r}, "
                    "which it does not have"
                )
        if joint.child in joints or joint.name in names:
            raise InputError(
                f"{file.name} is broken: joint {joint.name!r} appears twice, or link "
                f"{joint.child!r} hangs on two joints"
            )
        names.add(joint.name)
        joints[joint.child] = joint
    roots = [link for link in links if link not in joints]
    if len(roots) != 1:
        raise InputError(f"{file.name} is no tree of links: it has {len(roots)} root links")
    tree = Tree(_with_unique_names(robot), file, links, joints)
    for link in links:
        _refuse_loop(tree, link)
    return tree


def link_frame(link: str) -> str:
    """What a link is called in `Tree.xml`."""
    return f"link:{link}"


def joint_frame(joint: str) -> str:
    """What a joint is called in `Tree.xml`."""
    return f"joint:{joint}"


def _with_unique_names(robot: ET.Element) -> str:
    for link in robot.findall("link"):
        link.set("name", link_frame(link.get("name", "")))
    for joint in robot.findall("joint"):
        joint.set("name", joint_frame(joint.get("name", "")))
        for tag in ("parent", "child"):
            for end in joint.findall(tag):
                end.set("link", link_frame(end.get("link", "")))
        for mimic in joint.findall("mimic"):
            mimic.set("joint", joint_frame(mimic.get("joint", "")))
    return ET.tostring(robot, encoding="unicode")


def _refuse_loop(tree: Tree, link: str) -> None:
    seen: set[str] = set()
    while link in tree.joints:
        if link in seen:
            raise InputError(f"{tree.file.name} is no tree: link {link!r} is part of a loop")
        seen.add(link)
        link = tree.joints[link].parent


def _is_xacro(file: Path) -> InputError:
    return InputError(
        f"{file.name} is xacro, not URDF; run: xacro {file.name} > "
        f"{file.name.split('.')[0]}_expanded.urdf, and name that"
    )


def _joint(element: ET.Element, file: Path) -> TreeJoint:
    def end(tag: str) -> str:
        found = element.find(tag)
        return found.get("link", "") if found is not None else ""

    limit, mimic, axis = (element.find(tag) for tag in ("limit", "mimic", "axis"))
    name = element.get("name", "")
    if not name:
        raise InputError(f"{file.name} is broken: a joint has no name")
    direction = axis.get("xyz", "") if axis is not None else "1 0 0"
    if element.get("type") in MOVABLE and not any(x.strip("+-0.eE") for x in direction.split()):
        raise InputError(f"{file.name} is broken: joint {name!r} has the axis {direction!r}")
    return TreeJoint(
        name=name,
        kind=element.get("type", ""),
        parent=end("parent"),
        child=end("child"),
        mimics=mimic.get("joint", "") if mimic is not None else None,
        has_effort=limit is not None and limit.get("effort") is not None,
        has_velocity=limit is not None and limit.get("velocity") is not None,
    )
