"""A URDF's tree of links and joints in plain numbers, with what is wrong of each by name."""

from __future__ import annotations

import contextlib
import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from xml.parsers import expat

import numpy as np

from copose.errors import InputError, nearest, shown, together
from copose.poses import Array, Pose, frozen_array
from copose.problem import read_bytes
from copose.robots.arm import Body, motion
from copose.robots.xacro_file import XACRO, expanded

MOVABLE = ("revolute", "continuous", "prismatic")
_MOST_BYTES = 50_000_000
_MOST_JOINTS = 2_000
# Lengths, masses and inertias beyond this are no robot's, and their products overflow.
_LARGEST = 1e9

# How a file begins whose encoding needs no declaration.
_MARKS = (
    (b"\xef\xbb\xbf", "utf-8"),
    (b"\xff\xfe\0\0", "utf-32"),
    (b"\0\0\xfe\xff", "utf-32"),
    (b"\xff\xfe", "utf-16"),
    (b"\xfe\xff", "utf-16"),
    (b"<\0", "utf-16-le"),
    (b"\0<", "utf-16-be"),
)
_DECLARED = re.compile(rb"\s*<\?xml[^>]*?\sencoding\s*=\s*[\"']([A-Za-z][\w.-]*)[\"']")
# What no robot is read from: hand-written comments often hold '--', which XML does not allow.
_ASIDE = re.compile(r"<\?xml\s.*?\?>|<!--.*?-->", re.DOTALL)


@dataclass(frozen=True)
class Mimic:
    """What a joint follows: it stands at multiplier · leader + offset."""

    leader: str
    multiplier: float
    offset: float


@dataclass(frozen=True, eq=False)
class TreeJoint:
    """A joint of the tree as it is written.

    Attributes:
        name: its own.
        kind: the ``type``; empty where there is none.
        parent: name of the link that it hangs on.
        child: name of the link that it moves.
        origin: T_parent_child at position 0.
        axis: unit axis in the child's frame.
        lower: lowest position, 0 where ``<limit>`` leaves it out; ``upper`` alike.
        effort: as written; None where there is no number.
        velocity: alike.
        mimic: what it follows, if anything.
        faults: what cannot be read, by the part that it spoils: ``origin``, ``axis``, ``limit``,
            ``effort``, ``velocity``, ``mimic``. The part itself is then a stand-in.
    """

    name: str
    kind: str
    parent: str
    child: str
    origin: Pose
    axis: Array
    lower: float
    upper: float
    effort: float | None
    velocity: float | None
    mimic: Mimic | None
    faults: Mapping[str, str]

    def at(self, position: float) -> Pose:
        """T_parent_child at a position, rad or m."""
        if position == 0:
            return self.origin
        return self.origin @ motion(self.kind, self.axis, position)


@dataclass(frozen=True, eq=False)
class TreeLink:
    """A link of the tree as it is written.

    Attributes:
        element: its XML.
        body: its inertial in the link's frame; None where there is none that can be read.
        fault: why an inertial cannot be read, else empty.
    """

    element: ET.Element
    body: Body | None
    fault: str


@dataclass(frozen=True, eq=False)
class Standing:
    """Where joints stand that are not free.

    Attributes:
        at: by joint, its own position, what it mimics, or 0, as which free joints count; rad or m.
        faults: by follower, why its position is not known.
        moved: by follower, the free joint that it moves with.
    """

    at: Mapping[str, float]
    faults: Mapping[str, str]
    moved: Mapping[str, str]


@dataclass(frozen=True, eq=False)
class Tree:
    """Links and joints of a URDF.

    Attributes:
        file: where it was read.
        name: the robot's.
        links: by name, in file order.
        joints: by the name of their child link, in file order.
        root: the link that no joint moves.
        order: the joints, each behind the one that it hangs on.
        arguments: of the .xacro that the file is.
        foreign: what xacro left in the file, such as ``xacro:property``.
    """

    file: Path
    name: str
    links: Mapping[str, TreeLink]
    joints: Mapping[str, TreeJoint]
    root: str
    order: tuple[TreeJoint, ...]
    foreign: tuple[str, ...]
    arguments: tuple[tuple[str, str], ...] = ()

    @property
    def source(self) -> object:
        """Equal for trees of one file, by one set of arguments."""
        return self.file, self.arguments

    @cached_property
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
                raise self.fault(
                    f"{link!r} is no link of {self.file.name}{nearest(link, self.links)}", key
                )
        above = self.ancestors(tip)
        parents = [joint.parent for joint in above]
        if root == tip:
            return []
        if root not in parents:
            raise self.fault(
                f"{root!r} is not above the tip {tip!r}; above it are {', '.join(parents)}", "root"
            )
        return above[parents.index(root) :: -1]

    def standing(self, locked: Mapping[str, float], free: Collection[str] = ()) -> Standing:
        """Where movable joints stand that are not free.

        Args:
            locked: positions of their own by joint.
            free: names of the joints that move.
        """
        at = dict.fromkeys(free, 0.0) | dict(locked)
        faults: dict[str, str] = {}
        moved: dict[str, str] = {}
        for name in self.movable:
            trail: list[str] = []
            while name not in at and name in self.movable:
                if name in trail:
                    ring = trail[trail.index(name) :]
                    text = f"joints {', '.join(map(repr, ring))} mimic each other"
                    text = f"joint {name!r} mimics itself" if len(ring) == 1 else text
                    faults |= dict.fromkeys(ring, text)
                    at |= dict.fromkeys(ring, 0.0)
                    break
                trail.append(name)
                mimic = self.movable[name].mimic
                if mimic is None:
                    at[name] = 0.0
                else:
                    name = mimic.leader
            for follower in reversed([name for name in trail if name not in at]):
                joint = self.movable[follower]
                assert joint.mimic is not None
                leader = joint.mimic.leader
                at[follower] = joint.mimic.multiplier * at.get(leader, 0.0) + joint.mimic.offset
                if leader in free or leader in moved:
                    moved[follower] = moved.get(leader, leader)
                if leader in faults or "mimic" in joint.faults:
                    faults[follower] = joint.faults.get("mimic") or faults[leader]
                elif leader not in self.movable:
                    faults[follower] = (
                        f"joint {follower!r} mimics {leader!r}, which is no movable joint of "
                        f"{self.file.name}{nearest(leader, self.movable)}; or lock {follower!r}"
                    )
        return Standing(at, faults, moved)

    def placed(
        self, positions: Mapping[str, float], free: Collection[str] = ()
    ) -> dict[str, tuple[str | None, Pose]]:
        """By link, the free joint that moves it, and its pose in that joint's frame.

        Args:
            positions: of the movable joints, see `Standing`; all others are at rest.
            free: names of the joints that move.

        Returns:
            The frame of a free joint is its child link's; links that none moves have None, and
            their pose in the root link's frame with all free joints at 0.
        """
        at: dict[str, tuple[str | None, Pose]] = {self.root: (None, Pose.from_rpy())}
        for joint in self.order:
            carrier, pose = at[joint.parent]
            if joint.name in free:
                at[joint.child] = joint.name, Pose.from_rpy()
            else:
                at[joint.child] = carrier, pose @ joint.at(positions.get(joint.name, 0.0))
        return at

    def fault(self, text: str, key: str) -> InputError:
        """What is wrong with a robot, and that xacro left something in its file, if it did."""
        return InputError(f"{text}; {_xacro(self.file)}" if self.foreign else text, key=key)


def read_tree(
    file: Path,
    packages: Mapping[str, Path] | None = None,
    arguments: Mapping[str, str] | None = None,
) -> Tree:
    """Read a URDF's tree.

    Args:
        file: a URDF, or a .xacro, which is run.
        packages: folders of packages by name, for xacro.
        arguments: of a .xacro.

    Raises:
        InputError: no such file, broken XML or xacro, or no tree of links.
    """
    text = _text(read_bytes(file, _MOST_BYTES))
    if file.suffix == XACRO:
        text = expanded(file, arguments or {}, packages or {})
    robot = _parsed(text, file)
    if robot.tag != "robot":
        raise InputError(f"{file.name} is not a URDF: its root is <{robot.tag}>, not <robot>")
    foreign = _of_xacro(robot)
    links, joints = robot.findall("link"), robot.findall("joint")
    if len(joints) > _MOST_JOINTS:
        raise InputError(f"{file.name} has {len(joints)} joints; at most {_MOST_JOINTS} are read")
    faults = _structural_faults(links, joints)
    if faults:
        if foreign:
            raise InputError(_xacro(file))
        raise InputError(f"{file.name} is broken: {together(faults)}")
    by_child = {joint.child: joint for joint in map(_joint, joints)}
    roots = [name for name in map(_name, links) if name not in by_child]
    if len(roots) != 1:
        if foreign:
            raise InputError(_xacro(file))
        named = f": {', '.join(roots)}" if roots else ""
        raise InputError(f"{file.name} is no tree of links: it has {len(roots)} root links{named}")
    hanging: dict[str, list[TreeJoint]] = {}
    for joint in by_child.values():
        hanging.setdefault(joint.parent, []).append(joint)
    order = list(hanging.get(roots[0], []))
    for joint in order:
        order += hanging.get(joint.child, [])
    if len(order) < len(by_child):
        reached = {joint.child for joint in order}
        loop = next(link for link in by_child if link not in reached)
        raise InputError(f"{file.name} is no tree: link {loop!r} is part of a loop")
    return Tree(
        file=file,
        name=robot.get("name", ""),
        links={_name(element): _link(element) for element in links},
        joints=by_child,
        root=roots[0],
        order=tuple(order),
        foreign=foreign,
        arguments=tuple(sorted((arguments or {}).items())),
    )


def numbers(element: ET.Element, key: str, count: int, default: str = "") -> tuple[float, ...]:
    """So many numbers of an attribute, apart by blanks.

    Raises:
        ValueError: there are others, or none; the text says so.
    """
    text = element.get(key, default)
    # float also takes 1_000 and the digits of other scripts.
    plain = text.isascii() and "_" not in text
    try:
        values = tuple(float(word) for word in text.split()) if plain else ()
    except ValueError:
        values = ()
    if len(values) == count and all(abs(value) <= _LARGEST for value in values):
        return values
    if key not in element.attrib:
        raise ValueError(f"<{element.tag}> has no {key}")
    wanted = "a number" if count == 1 else f"{count} numbers"
    wanted += f" within ±{_LARGEST:g} {'is' if count == 1 else 'are'}"
    raise ValueError(f"{key} of <{element.tag}> is {shown(text)}; {wanted} needed")


def placement(element: ET.Element) -> Pose:
    """Where an element's ``<origin>`` puts it, by ``rpy`` or ``quat_xyzw``.

    Raises:
        ValueError: it does not say.
    """
    origin = element.find("origin")
    if origin is None:
        return Pose.from_rpy()
    position = numbers(origin, "xyz", 3, "0 0 0")
    if "quat_xyzw" not in origin.attrib:
        return Pose.from_rpy(position, numbers(origin, "rpy", 3, "0 0 0"))
    *vector, scalar = numbers(origin, "quat_xyzw", 4)
    norm = math.hypot(scalar, *vector)
    if "rpy" in origin.attrib or not norm > 1e-6:
        raise ValueError("<origin> has both rpy and quat_xyzw" if norm else "quat_xyzw is zero")
    return Pose.from_quaternion(position, [scalar, *vector])


def _text(raw: bytes) -> str:
    """What a file says, by its byte order mark, the encoding that it declares, or UTF-8.

    Else by Latin-1, which has every byte: a robot is not refused over its author's umlauts.
    """
    for mark, encoding in _MARKS:
        if raw.startswith(mark):
            return raw.decode(encoding, "replace").lstrip("\ufeff")
    declared = _DECLARED.match(raw)
    for encoding in (*([declared[1].decode()] if declared else []), "utf-8"):
        with contextlib.suppress(UnicodeError, LookupError):
            text = raw.decode(encoding)
            # A wrong declaration of two bytes a letter leaves no tag.
            if "<" in text:
                return text
    return raw.decode("latin-1")


def _parsed(text: str, file: Path) -> ET.Element:
    """The root element; prefixes of namespaces are parts of the names, bound or not."""
    blank = _ASIDE.sub(lambda aside: "\n" * aside.group().count("\n"), text)
    builder, parser = ET.TreeBuilder(), expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    try:
        parser.Parse(blank, True)
        return builder.close()
    except (expat.ExpatError, ValueError) as error:
        raise InputError(f"{file.name} is not XML: {error}") from None


def _structural_faults(links: Sequence[ET.Element], joints: Sequence[ET.Element]) -> list[str]:
    """What keeps links and joints from being told apart, or from hanging together."""
    faults = ["it has no links"] if not links else []
    seen: dict[str, set[str]] = {"link": set(), "joint": set(), "child": set()}
    for element in (*links, *joints):
        name = _name(element)
        if not name:
            faults.append(f"a {element.tag} has no name")
        elif name in seen[element.tag]:
            faults.append(f"{element.tag} {name!r} appears twice")
        seen[element.tag].add(name)
    for joint in joints:
        name = _name(joint)
        faults += [
            f"joint {name!r} names the link {_end(joint, tag)!r}, which it does not have"
            for tag in ("parent", "child")
            if _end(joint, tag) not in seen["link"]
        ]
        child = _end(joint, "child")
        if child in seen["child"]:
            faults.append(f"link {child!r} hangs on two joints")
        seen["child"].add(child)
    return list(dict.fromkeys(faults))


def _of_xacro(robot: ET.Element) -> tuple[str, ...]:
    """The tags that belong to xacro, by the name that its namespace has or by ``xacro`` itself."""
    bound = {
        key.removeprefix("xmlns:")
        for key, value in robot.attrib.items()
        if key.startswith("xmlns:") and "xacro" in value
    }
    tags = dict.fromkeys(element.tag for element in robot.iter())
    return tuple(tag for tag in tags if tag.partition(":")[0] in {"xacro", *bound})


def _name(element: ET.Element) -> str:
    return element.get("name", "")


def _end(joint: ET.Element, tag: str) -> str:
    end = joint.find(tag)
    return end.get("link", "") if end is not None else ""


def _xacro(file: Path) -> str:
    return (
        f"{file.name} is xacro, not URDF; run: xacro {file.name} > "
        f"{file.name.split('.')[0]}_expanded.urdf, and name that"
    )


def _link(element: ET.Element) -> TreeLink:
    inertial = element.find("inertial")
    if inertial is None:
        return TreeLink(element, None, "")
    try:
        (mass,) = numbers(_part(inertial, "mass"), "value", 1)
        moments = _part(inertial, "inertia")
        xx, xy, xz, yy, yz, zz = (
            numbers(moments, key, 1)[0] for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        )
        if mass < 0:
            raise ValueError(f"its mass is {mass:g}, below zero")
        inertia = frozen_array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        body = Body(mass, frozen_array(np.zeros(3)), inertia).placed(placement(inertial))
    except ValueError as error:
        return TreeLink(element, None, f"link {_name(element)!r}: {error}")
    return TreeLink(element, body, "")


def _part(element: ET.Element, tag: str) -> ET.Element:
    part = element.find(tag)
    if part is None:
        raise ValueError(f"<{element.tag}> has no <{tag}>")
    return part


def _joint(element: ET.Element) -> TreeJoint:
    name, faults = _name(element), dict[str, str]()

    @contextlib.contextmanager
    def noting(part: str) -> Iterator[None]:
        try:
            yield
        except ValueError as error:
            faults[part] = f"joint {name!r}: {error}"

    origin, along, lower, upper = Pose.from_rpy(), np.array([1.0, 0.0, 0.0]), 0.0, 0.0
    limit, axis, mimic = (element.find(tag) for tag in ("limit", "axis", "mimic"))
    with noting("origin"):
        origin = placement(element)
    with noting("axis"):
        if axis is not None:
            along = _direction(axis)
    with noting("limit"):
        lower, upper = (_limit(_part(element, "limit"), key, "0") for key in ("lower", "upper"))
    given: dict[str, float | None] = dict.fromkeys(("effort", "velocity"))
    for key in given:
        with noting(key):
            if limit is not None and key in limit.attrib:
                given[key] = _limit(limit, key)
    followed = None
    if mimic is not None:
        followed = Mimic(mimic.get("joint", ""), 1.0, 0.0)
        with noting("mimic"):
            (factor,), (offset,) = (
                numbers(mimic, key, 1, default)
                for key, default in (("multiplier", "1"), ("offset", "0"))
            )
            followed = Mimic(followed.leader, factor, offset)
    return TreeJoint(
        name=name,
        kind=element.get("type", ""),
        parent=_end(element, "parent"),
        child=_end(element, "child"),
        origin=origin,
        axis=frozen_array(along),
        lower=lower,
        upper=upper,
        effort=given["effort"],
        velocity=given["velocity"],
        mimic=followed,
        faults=faults,
    )


def _direction(axis: ET.Element) -> Array:
    along = np.array(numbers(axis, "xyz", 3))
    size = np.abs(along).max()
    if size == 0:
        raise ValueError(f"its axis is {axis.get('xyz')!r}, which has no direction")
    along = along / size
    return np.asarray(along / np.linalg.norm(along))


def _limit(limit: ET.Element, key: str, default: str = "") -> float:
    """A limit, of any size: what is too large for a number is infinite."""
    text = limit.get(key, default)
    with contextlib.suppress(ValueError):
        value = float(text)
        if not math.isnan(value) and "_" not in text:
            return value
    raise ValueError(f"{key} of <limit> is {shown(text)}; a number is needed")
