"""A URDF as a tree of links and joints, with what is wrong of each by name."""

from __future__ import annotations

import contextlib
import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from xml.parsers import expat

import numpy as np

from copose.errors import InputError, shown, together
from copose.poses import Array, Pose, frozen_array
from copose.problem import read_bytes
from copose.robots.arm import Body
from copose.robots.files.tree import (
    READING_LIMITS,
    Mimic,
    ReadingLimits,
    Tree,
    TreeJoint,
    TreeLink,
    box_corners,
)
from copose.robots.files.xacro_file import XACRO, expanded, unexpanded


def read_tree(
    file: Path,
    packages: Mapping[str, Path] | None = None,
    arguments: Mapping[str, str] | None = None,
    limits: ReadingLimits = READING_LIMITS,
) -> Tree:
    """The tree of a URDF, or of a .xacro, which is run with its arguments and packages by name.

    Raises:
        InputError: no such file, broken XML or xacro, or no tree of links.
    """
    text = _text(read_bytes(file, limits.bytes))
    if file.suffix == XACRO:
        text = expanded(file, arguments or {}, packages or {})
    robot = _parsed(text, file)
    if robot.tag != "robot":
        hint = "; name a MuJoCo model by mjcf" if robot.tag == "mujoco" else ""
        raise InputError(f"{file.name} is not a URDF: its root is <{robot.tag}>, not <robot>{hint}")
    foreign = _of_xacro(robot)
    links, joints = robot.findall("link"), robot.findall("joint")
    if len(joints) > limits.joints:
        raise InputError(f"{file.name} has {len(joints)} joints; at most {limits.joints} are read")
    faults = _structural_faults(links, joints)
    if faults:
        if foreign:
            raise InputError(unexpanded(file))
        raise InputError(f"{file.name} is broken: {together(faults)}")
    by_child = {joint.child: joint for joint in map(_joint, joints)}
    roots = [name for name in map(_name, links) if name not in by_child]
    if len(roots) != 1:
        if foreign:
            raise InputError(unexpanded(file))
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
        expansion=text if file.suffix == XACRO else "",
    )


def numbers(
    element: ET.Element,
    key: str,
    count: int,
    default: str = "",
    largest: float = READING_LIMITS.number,
) -> tuple[float, ...]:
    """The numbers of an attribute, separated by blanks.

    Raises:
        ValueError: there are more or fewer than ``count``, or one is too large; the text says so.
    """
    text = element.get(key, default)
    # float also takes 1_000 and the digits of other scripts.
    plain = text.isascii() and "_" not in text
    try:
        values = tuple(float(word) for word in text.split()) if plain else ()
    except ValueError:
        values = ()
    if len(values) == count and all(abs(value) <= largest for value in values):
        return values
    if key not in element.attrib:
        raise ValueError(f"<{element.tag}> has no {key}")
    legal = "a number" if count == 1 else f"{count} numbers"
    legal += f" within ±{largest:g} {'is' if count == 1 else 'are'}"
    raise ValueError(f"{key} of <{element.tag}> is {shown(text)}; {legal} needed")


def origin_pose(element: ET.Element) -> Pose:
    """The pose of an element by its ``<origin>``, by ``rpy`` or ``quat_xyzw``.

    Raises:
        ValueError: the origin cannot be read.
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
    """The text of a file, by its byte order mark, the encoding that it declares, or UTF-8.

    Else by Latin-1, which has every byte: a robot is not refused over its author's umlauts.
    """
    marks = (
        (b"\xef\xbb\xbf", "utf-8"),
        (b"\xff\xfe\0\0", "utf-32"),
        (b"\0\0\xfe\xff", "utf-32"),
        (b"\xff\xfe", "utf-16"),
        (b"\xfe\xff", "utf-16"),
        (b"<\0", "utf-16-le"),
        (b"\0<", "utf-16-be"),
    )
    for mark, encoding in marks:
        if raw.startswith(mark):
            return raw.decode(encoding, "replace").lstrip("\ufeff")
    declared = re.match(rb"\s*<\?xml[^>]*?\sencoding\s*=\s*[\"']([A-Za-z][\w.-]*)[\"']", raw)
    for encoding in (*([declared[1].decode()] if declared else []), "utf-8"):
        with contextlib.suppress(UnicodeError, LookupError):
            text = raw.decode(encoding)
            # Where two bytes a letter are wrongly declared no tag is left.
            if "<" in text:
                return text
    return raw.decode("latin-1")


def _parsed(text: str, file: Path) -> ET.Element:
    """The root element; prefixes of namespaces are parts of the names, bound or not.

    Comments are taken out before: hand-written ones often hold '--', which XML does not allow.
    """
    aside = re.compile(r"<\?xml\s.*?\?>|<!--.*?-->", re.DOTALL)
    blank = aside.sub(lambda match: "\n" * match.group().count("\n"), text)
    builder, parser = ET.TreeBuilder(), expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    try:
        parser.Parse(blank, True)
        return builder.close()
    except (expat.ExpatError, ValueError) as error:
        raise InputError(f"{file.name} is not XML: {error}") from None


def _structural_faults(links: Sequence[ET.Element], joints: Sequence[ET.Element]) -> list[str]:
    """Reasons why links and joints cannot be told apart, or do not hang together."""
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
    """The tags of xacro's namespace, by the prefix that is bound to it or by ``xacro`` itself."""
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


def _link(element: ET.Element) -> TreeLink:
    body, fault = None, ""
    try:
        body = _body(element)
    except ValueError as error:
        fault = f"link {_name(element)!r}: {error}"
    return TreeLink(body, fault, *_outline(element), element)


def _body(link: ET.Element) -> Body | None:
    inertial = link.find("inertial")
    if inertial is None:
        return None
    (mass,) = numbers(_part(inertial, "mass"), "value", 1)
    moments = _part(inertial, "inertia")
    xx, xy, xz, yy, yz, zz = (
        numbers(moments, key, 1)[0] for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    if mass < 0:
        raise ValueError(f"its mass is {mass:g}, below zero")
    inertia = frozen_array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return Body(mass, frozen_array(np.zeros(3)), inertia).placed(origin_pose(inertial))


def _outline(link: ET.Element) -> tuple[Array, bool]:
    """Corners of the boxes round a link's shapes, and whether these are all of it."""
    known, unknown = [np.zeros((0, 3))], False
    shapes = [element for tag in ("collision", "visual") for element in link.findall(tag)]
    for element in shapes:
        shape = element.find("geometry/*")
        try:
            if shape is None or shape.tag == "mesh":
                raise ValueError
            pose = origin_pose(element)
            known.append(_corners(shape) @ pose.rotation.T + pose.position)
        except ValueError:
            unknown = True
    return np.vstack(known), bool(shapes) and not unknown


def _corners(shape: ET.Element) -> Array:
    """Corners of the box round a shape in its own frame, (8, 3).

    Raises:
        ValueError: it cannot be read.
    """
    if shape.tag == "box":
        return box_corners(np.array(numbers(shape, "size", 3)) / 2)
    (radius,) = numbers(shape, "radius", 1)
    half = np.full(3, radius)
    if shape.tag != "sphere":
        (length,) = numbers(shape, "length", 1)
        half[2] = length / 2 + (radius if shape.tag == "capsule" else 0.0)
    return box_corners(half)


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
        origin = origin_pose(element)
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
        followed = Mimic(mimic.get("joint", ""), (0.0, 1.0))
        with noting("mimic"):
            (factor,), (offset,) = (
                numbers(mimic, key, 1, default)
                for key, default in (("multiplier", "1"), ("offset", "0"))
            )
            followed = Mimic(followed.leader, (offset, factor))
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
