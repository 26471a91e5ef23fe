"""The links of robots as solids, each carried by the joint that moves it, or standing still."""

from __future__ import annotations

import contextlib
import xml.etree.ElementTree as ET
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from copose.collision.carriers import Carrier
from copose.collision.links.link_geometry import LinkPair
from copose.collision.links.link_shapes import LINK_FORMATS, LinkShapes
from copose.collision.shapes.solids import LinkLook, LinkSolids, Solid
from copose.errors import InputError, arm_key, shown, together
from copose.poses import Pose
from copose.problem import Problem, RobotArm, read_text
from copose.robots import Arm
from copose.robots.chain_arm import joint_faults
from copose.robots.files.tree import Tree
from copose.robots.robot import Robot, RobotsRead, coincide, read_robot
from copose.selection import groups


def ignored_links(
    tree: Tree, arms: Mapping[int, Any], most_bytes: int = 5_000_000
) -> tuple[set[LinkPair], list[str]]:
    """Pairs of links that are not tested, and notes that count them.

    Raises:
        InputError: a problem names a link that the robot does not have.
    """
    ignored: set[LinkPair] = set()
    notes: list[str] = []
    for i, arm in arms.items():
        if not isinstance(arm, RobotArm):
            continue
        for pair in arm.ignore_collisions:
            unknown = next((link for link in pair if link not in tree.links), None)
            if unknown is not None:
                raise InputError(
                    f"{tree.file.name} has no link {shown(unknown)}",
                    key=f"{arm_key(i, arm.name)}.ignore_collisions",
                )
        if arm.ignore_collisions:
            ignored |= set(arm.ignore_collisions)
            notes.append(
                f"{_counted(len(arm.ignore_collisions))} by ignore_collisions of arm {arm.name!r}"
            )
    for reason, pairs in LINK_FORMATS[tree.format].kept_apart(tree).items():
        if pairs:
            ignored |= pairs
            notes.append(f"{_counted(len(pairs))} by {reason} of {tree.file.name}")
    file = tree.file.with_suffix(".srdf")
    if file.is_file():
        try:
            root = ET.fromstring(read_text(file, most_bytes))
        except (InputError, ET.ParseError) as error:
            notes.append(f"{file.name} cannot be read, and disables no pair of links: {error}")
        else:
            disabled = [
                (element.get("link1", ""), element.get("link2", ""))
                for element in root.iterfind("disable_collisions")
            ]
            if disabled:
                ignored |= set(disabled)
                notes.append(f"{_counted(len(disabled))} by {file.name}")
    return ignored, notes


def _counted(count: int) -> str:
    return f"collisions of {count} pair{'s' if count > 1 else ''} of links are ignored"


@dataclass(frozen=True, eq=False)
class _Member:
    """An arm as part of its robot."""

    number: int  # which arm of the problem
    arm: Arm
    kind: str  # key of its robot's file
    locked: Mapping[str, float]  # its joints that are held still, as in the problem
    root: str  # its root link
    # Of each link the joint that moves it and its pose, see `Tree.placed`.
    links: Mapping[str, tuple[str | None, Pose]]
    origin: Pose  # T_world_universe

    @classmethod
    def of(cls, number: int, spec: RobotArm, arm: Arm, tree: Tree) -> _Member:
        names = arm.joint_names
        links = tree.placed(tree.standing(spec.locked, names).at, names)
        root = tree.root if spec.root is None else spec.root
        origin = arm.base @ links[root][1].inverse()
        return cls(number, arm, spec.kind, spec.locked, root, links, origin)


@dataclass(frozen=True, eq=False)
class _Team:
    """The arms of one robot: one file at one base."""

    robot: Robot  # its file, read
    members: list[_Member]  # its arms, in file order

    @property
    def tree(self) -> Tree:
        """Links and joints of its file."""
        return self.robot.tree

    def places(self, links: Collection[str]) -> dict[str, tuple[str, Carrier, Pose]]:
        """The arm's name, the carrier and the pose in the carrier's frame of some links; static
        links are in the root frame of the robot's first arm.

        Raises:
            InputError: the pose of one cannot be read.
        """
        first, tree = self.members[0], self.tree
        held = tree.standing(self._locked())
        needed = {j.name: j for link in links for j in tree.ancestors(link)}
        faults = [fault for fault in joint_faults(list(needed.values()), (), held) if fault]
        if faults:
            raise InputError(together(faults), key=arm_key(first.number, first.arm.name))
        standing = tree.placed(held.at)
        universe = standing[first.root][1].inverse()
        carried = {}
        for link in links:
            name, carrier = first.arm.name, Carrier("root", first.number)
            pose = universe @ standing[link][1]
            for member in self.members:
                mover, place = member.links[link]
                if mover is not None:
                    j = member.arm.joint_names.index(mover)
                    name, carrier = member.arm.name, Carrier("joint", member.number, j)
                    pose = place
            carried[link] = name, carrier, pose
        return carried

    def solids(self, shapes: LinkShapes) -> list[Solid]:
        """The links with a shape, the static ones first.

        Raises:
            InputError: the pose of one cannot be read.
        """
        return sorted(
            (
                Solid(f"{name}/{link}", carrier, pose, shapes.parts[link])
                for link, (name, carrier, pose) in self.places(shapes.parts).items()
            ),
            key=lambda solid: (not solid.carrier.static, solid.carrier.arm, solid.carrier.joint),
        )

    def mounts(self, links: Collection[str]) -> set[tuple[int, str]]:
        """(arm, name) of the static solids that are one body with the parent of joint 0."""
        tree = self.tree
        hangs_on = {joint.name: joint.parent for joint in tree.joints.values()}
        mounts = set()
        for member in self.members:
            body = _anchor(tree, hangs_on[member.arm.joint_names[0]])
            for link in links:
                if _anchor(tree, link) == body:
                    mounts.add((member.number, f"{self.members[0].arm.name}/{link}"))
        return mounts

    def _locked(self) -> dict[str, float]:
        """Positions of joints that are held still, rad or m; of several arms' the first counts."""
        locked: dict[str, float] = {}
        for member in reversed(self.members):
            locked |= member.locked
        return locked


def robot_solids(problem: Problem, arms: Sequence[Arm]) -> LinkSolids:
    """The solids of a problem's robots.

    Raises:
        InputError: a robot cannot be read, or gives no shape to any link that an arm moves.
    """
    teams = _teams(problem, arms)
    shapes = {robot: LinkShapes.of(robot) for robot in dict.fromkeys(t.robot for t in teams)}
    solids: list[Solid] = []
    mounts: set[tuple[int, str]] = set()
    ignored: set[frozenset[str]] = set()
    notes: list[str] = []
    for team in teams:
        own = shapes[team.robot]
        links = team.solids(own)
        solids += links
        mounts |= team.mounts(own.parts)
        names = {solid.name.partition("/")[2]: solid.name for solid in links}
        pairs, ignored_notes = ignored_links(
            team.tree, {member.number: problem.arms[member.number] for member in team.members}
        )
        notes += ignored_notes
        ignored |= {frozenset((names[a], names[b])) for a, b in pairs if a in names and b in names}
        if problem.constraints.collision and own.faults:
            raise _unreadable(team, own)
        for member in team.members:
            if not any(s.carrier.kind == "joint" and s.carrier.arm == member.number for s in links):
                raise _without_shape(team, member)
    notes += [note for own in shapes.values() for note in (*own.notes, *own.large)]
    return LinkSolids(tuple(solids), frozenset(mounts), frozenset(ignored), tuple(notes))


def robot_looks(problem: Problem, arms: Sequence[Arm]) -> list[LinkLook]:
    """Shapes by which the links of a problem's robots are shown; none of robots whose links cannot
    be placed. No mesh file of a URDF is read yet.

    Raises:
        InputError: a robot cannot be read.
    """
    teams = _teams(problem, arms)
    looks = {
        robot: LINK_FORMATS[robot.tree.format].looks(robot)
        for robot in dict.fromkeys(team.robot for team in teams)
    }
    shown = []
    for team in teams:
        choices = {link: parts for link, parts in looks[team.robot].items() if any(parts)}
        with contextlib.suppress(InputError):
            for link, (_, carrier, pose) in team.places(choices).items():
                shared = carrier.kind == "root" and len(team.members) > 1
                shown.append(LinkLook(link, carrier, pose, choices[link], shared))
    return shown


def _teams(problem: Problem, arms: Sequence[Arm]) -> list[_Team]:
    """The robots of a problem, each file read once.

    Raises:
        InputError: one cannot be read.
    """
    folder = problem.source.parent if problem.source is not None else Path()
    robots: RobotsRead = {}
    parts: list[tuple[Robot, _Member]] = []
    for i, (spec, arm) in enumerate(zip(problem.arms, arms, strict=True)):
        if not isinstance(spec, RobotArm):
            continue
        robot = read_robot(spec, folder, arm_key(i, arm.name), robots)
        parts.append((robot, _Member.of(i, spec, arm, robot.tree)))
    teams = groups(parts, _one_robot)
    return [_Team(team[0][0], [member for _, member in team]) for team in teams]


def _one_robot(one: tuple[Robot, _Member], other: tuple[Robot, _Member]) -> bool:
    """True for two arms, each with its robot's file, of one robot."""
    same = one[0].tree.source == other[0].tree.source
    return same and coincide(one[1].origin, other[1].origin)


def large_links(problem: Problem) -> tuple[str, ...]:
    """Notes on links of robots that are larger than any robot's; no shape need be readable."""
    folder = problem.source.parent if problem.source is not None else Path()
    robots: RobotsRead = {}
    for i, spec in enumerate(problem.arms):
        if isinstance(spec, RobotArm):
            read_robot(spec, folder, arm_key(i, spec.name), robots)
    shapes = (LinkShapes.of(robot, measured=True) for robot in robots.values())
    return tuple(dict.fromkeys(note for links in shapes for note in links.large))


def _unreadable(team: _Team, shapes: LinkShapes) -> InputError:
    first = team.members[0]
    faults = [f"link {link!r}: {why}" for link, why in shapes.faults.items()]
    if shapes.missing:
        # With a package all its links are missing: where it was sought tells more than their names.
        further = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
        faults = [f"{faults[0]}{further}; {shapes.missing[0]}"]
    return InputError(
        f"collision needs shapes of {team.tree.file.name} that cannot be read: {together(faults)}",
        key=f"{arm_key(first.number, first.arm.name)}.{first.kind}",
    )


def _without_shape(team: _Team, member: _Member) -> InputError:
    needed = LINK_FORMATS[team.tree.format].elements
    return InputError(
        f"{team.tree.file.name} has no shape for any link that the arm moves; collision needs "
        f"{needed}",
        key=f"{arm_key(member.number, member.arm.name)}.{member.kind}",
    )


def _anchor(tree: Tree, link: str) -> str:
    """The uppermost link that fixed joints alone tie a link to."""
    while link in tree.joints and tree.joints[link].kind == "fixed":
        link = tree.joints[link].parent
    return link
