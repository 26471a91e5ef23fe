"""A URDF's tree of links as names, read before Pinocchio so that faults can be named."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

from copose.errors import InputError, nearest
from copose.problem import read_text

MOVABLE = ("revolute", "continuous", "prismatic")
_MOST_BYTES = 50_000_000


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
        text: the XML.
        file: where it was read.
        links: link names and whether each has inertials.
        joints: by the name of their child link.
    """

    text: str
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
    for element in robot.findall("joint"):
        joint = _joint(element, file)
        for link in (joint.parent, joint.child):
            if link not in links:
                raise InputError(
                    f"{file.name} is broken: joint {joint.name!r} names the link {link!r}, "
                    "which it does not have"
                )
        if joint.child in joints or joint.name in {j.name for j in joints.values()}:
            raise InputError(
                f"{file.name} is broken: joint {joint.name!r} appears twice, or link "
                f"{joint.child!r} hangs on two joints"
            )
        joints[joint.child] = joint
    roots = [link for link in links if link not in joints]
    if len(roots) != 1:
        raise InputError(f"{file.name} is no tree of links: it has {len(roots)} root links")
    tree = Tree(text, file, links, joints)
    for link in links:
        _refuse_loop(tree, link)
    return tree


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

    limit, mimic = element.find("limit"), element.find("mimic")
    name = element.get("name", "")
    if not name:
        raise InputError(f"{file.name} is broken: a joint has no name")
    return TreeJoint(
        name=name,
        kind=element.get("type", ""),
        parent=end("parent"),
        child=end("child"),
        mimics=mimic.get("joint", "") if mimic is not None else None,
        has_effort=limit is not None and limit.get("effort") is not None,
        has_velocity=limit is not None and limit.get("velocity") is not None,
    )
