"""The links of robots' arms as solids: which moves with which joint, and which stand still."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from copose.collision.carriers import Carrier
from copose.collision.ignored import ignored_links
from copose.collision.link_shapes import LinkShapes
from copose.collision.solids import LinkSolids, Solid
from copose.errors import InputError, arm_key, together
from copose.poses import Array, Pose
from copose.problem import Problem, RobotArm
from copose.robots import Arm
from copose.robots.robot import Robot, RobotsRead, joint_faults, read_robot
from copose.robots.tree import Tree


@dataclass(frozen=True, eq=False)
class _Member:
    """An arm as part of its robot.

    Attributes:
        number: which arm of the problem.
        arm: the arm.
        kind: key of its robot's file.
        locked: its joints that are held still, as in the problem.
        root: its root link.
        links: what moves each link and where it is, see `Tree.placed`.
        origin: T_world_universe.
    """

    number: int
    arm: Arm
    kind: str
    locked: Mapping[str, float]
    root: str
    links: Mapping[str, tuple[str | None, Pose]]
    origin: Pose

    @classmethod
    def of(cls, number: int, spec: RobotArm, arm: Arm, tree: Tree) -> _Member:
        names = arm.joint_names
        links = tree.placed(tree.standing(spec.locked, names).at, names)
        root = tree.root if spec.root is None else spec.root
        origin = arm.base @ links[root][1].inverse()
        return cls(number, arm, spec.kind, spec.locked, root, links, origin)


@dataclass(frozen=True, eq=False)
class _Team:
    """The arms of one robot: one file at one base.

    Attributes:
        tree: what its file says.
        shapes: of its links.
        members: its arms, in file order.
    """

    tree: Tree
    shapes: LinkShapes
    members: list[_Member]

    def takes(self, tree: Tree, member: _Member) -> bool:
        """Whether an arm is one of this robot."""
        return self.tree.source == tree.source and bool(
            np.allclose(_rows(self.members[0].origin), _rows(member.origin), rtol=0, atol=1e-9)
        )

    def solids(self) -> list[Solid]:
        """The links with a shape, the static ones in the root frame of the robot's first arm.

        Raises:
            InputError: where one is cannot be read.
        """
        first, tree = self.members[0], self.tree
        held = tree.standing(self._locked())
        needed = {j.name: j for link in self.shapes.parts for j in tree.ancestors(link)}
        faults = [fault for fault in joint_faults(list(needed.values()), (), held) if fault]
        if faults:
            raise InputError(together(faults), key=arm_key(first.number, first.arm.name))
        standing = tree.placed(held.at)
        universe = standing[first.root][1].inverse()
        found = []
        for link, parts in self.shapes.parts.items():
            name, carrier = first.arm.name, Carrier("root", first.number)
            pose = universe @ standing[link][1]
            for member in self.members:
                mover, place = member.links[link]
                if mover is not None:
                    j = member.arm.joint_names.index(mover)
                    name, carrier = member.arm.name, Carrier("joint", member.number, j)
                    pose = place
            found.append(Solid(f"{name}/{link}", carrier, pose, parts))
        return sorted(
            found,
            key=lambda solid: (not solid.carrier.static, solid.carrier.arm, solid.carrier.joint),
        )

    def mounts(self) -> set[tuple[int, str]]:
        """(arm, name) of the static solids that are one body with what joint 0 hangs on."""
        tree = self.tree
        hangs_on = {joint.name: joint.parent for joint in tree.joints.values()}
        found = set()
        for member in self.members:
            body = _anchor(tree, hangs_on[member.arm.joint_names[0]])
            for link in self.shapes.parts:
                if _anchor(tree, link) == body:
                    found.add((member.number, f"{self.members[0].arm.name}/{link}"))
        return found

    def _locked(self) -> dict[str, float]:
        """Where the joints are held that carry static links; the first arm's word counts."""
        locked: dict[str, float] = {}
        for member in reversed(self.members):
            locked |= member.locked
        return locked


def robot_solids(problem: Problem, arms: Sequence[Arm]) -> LinkSolids:
    """The solids of a problem's robots.

    Raises:
        InputError: a robot cannot be read, or gives no shape to any link that an arm moves.
    """
    folder = problem.source.parent if problem.source is not None else Path()
    robots: RobotsRead = {}
    shapes: dict[Robot, LinkShapes] = {}
    teams: list[_Team] = []
    for i, (spec, arm) in enumerate(zip(problem.arms, arms, strict=True)):
        if not isinstance(spec, RobotArm):
            continue
        robot = read_robot(spec, folder, arm_key(i, arm.name), robots)
        if robot not in shapes:
            shapes[robot] = LinkShapes.of(robot)
        member = _Member.of(i, spec, arm, robot.tree)
        team = next((team for team in teams if team.takes(robot.tree, member)), None)
        if team is None:
            team = _Team(robot.tree, shapes[robot], [])
            teams.append(team)
        team.members.append(member)
    solids: list[Solid] = []
    mounts: set[tuple[int, str]] = set()
    ignored: set[frozenset[str]] = set()
    notes: list[str] = []
    for team in teams:
        found = team.solids()
        solids += found
        mounts |= team.mounts()
        names = {solid.name.partition("/")[2]: solid.name for solid in found}
        pairs, said = ignored_links(
            team.tree, {member.number: problem.arms[member.number] for member in team.members}
        )
        notes += said
        ignored |= {frozenset((names[a], names[b])) for a, b in pairs if a in names and b in names}
        if problem.constraints.collision and team.shapes.faults:
            raise _unreadable(team)
        for member in team.members:
            if not any(s.carrier.kind == "joint" and s.carrier.arm == member.number for s in found):
                raise _without_shape(team, member)
    notes += [note for links in shapes.values() for note in (*links.notes, *links.large)]
    return LinkSolids(tuple(solids), frozenset(mounts), frozenset(ignored), tuple(notes))


def large_links(problem: Problem) -> tuple[str, ...]:
    """Notes on links of robots that are larger than any robot's; no shape need be readable."""
    folder = problem.source.parent if problem.source is not None else Path()
    robots: RobotsRead = {}
    for i, spec in enumerate(problem.arms):
        if isinstance(spec, RobotArm):
            read_robot(spec, folder, arm_key(i, spec.name), robots)
    shapes = (LinkShapes.of(robot, measured=True) for robot in robots.values())
    return tuple(dict.fromkeys(note for links in shapes for note in links.large))


def _unreadable(team: _Team) -> InputError:
    first = team.members[0]
    faults = [f"link {link!r}: {why}" for link, why in team.shapes.faults.items()]
    if team.shapes.missing:
        # Links fall with their package: where it was looked for says more than all their names.
        more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
        faults = [f"{faults[0]}{more}; {team.shapes.missing[0]}"]
    return InputError(
        f"collision needs shapes of {team.tree.file.name} that cannot be read: {together(faults)}",
        key=f"{arm_key(first.number, first.arm.name)}.{first.kind}",
    )


def _without_shape(team: _Team, member: _Member) -> InputError:
    needed = "geoms" if team.tree.model else "<collision> or <visual> elements"
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


def _rows(pose: Pose) -> Array:
    return np.column_stack([pose.rotation, pose.position])
