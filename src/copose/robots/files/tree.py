"""A robot's tree of links and joints in plain numbers, with what is wrong of each by name."""

from __future__ import annotations

import itertools
import xml.etree.ElementTree as ET
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from copose.errors import InputError, nearest
from copose.poses import Array, Pose
from copose.robots.arm import Body, joint_motion
from copose.robots.files.xacro_file import unexpanded

# Kinds of joints of one degree of freedom.
MOVABLE = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class ReadingLimits:
    """Limits of the robot files that are read."""

    bytes: int = 50_000_000
    joints: int = 2_000
    number: float = 1e9  # beyond it no length, mass or inertia is a robot's, and products overflow


READING_LIMITS = ReadingLimits()


@dataclass(frozen=True)
class Mimic:
    """A joint's position as a polynomial of another's, Σ coefficients[k] · leaderᵏ; the leader of a
    constant has no name.
    """

    leader: str
    coefficients: tuple[float, ...]

    def at(self, leader: float) -> float:
        """The follower's position at its leader's."""
        position = 0.0
        for coefficient in reversed(self.coefficients):
            position = position * leader + coefficient
        return position


@dataclass(frozen=True, eq=False)
class TreeJoint:
    """A joint of the tree as it is written."""

    name: str
    kind: str  # the ``type``; empty where there is none
    parent: str  # name of the link that it hangs on
    child: str  # name of the link that it moves
    origin: Pose  # T_parent_child at position 0
    axis: Array  # unit axis in the child's frame
    lower: float  # lowest position, 0 where ``<limit>`` leaves it out
    upper: float  # highest position, 0 where ``<limit>`` leaves it out
    effort: float | None  # limit as written; None where there is no number
    velocity: float | None  # limit as written; None where there is no number
    mimic: Mimic | None  # what it follows, if anything
    # What cannot be read, by the part that it spoils: ``origin``, ``axis``, ``limit``, ``effort``,
    # ``velocity``, ``mimic``. The part itself is then a stand-in. ``drive``: why no torque of its
    # own drives it.
    faults: Mapping[str, str]
    armature: float = 0.0  # reflected inertia of its rotor, kg·m² or kg
    # Of a joint that is free, remarks on what is read otherwise than the file says, each with the
    # joint's name.
    doubts: Mapping[str, str] = field(default_factory=dict)

    def at(self, position: float) -> Pose:
        """T_parent_child at a position, rad or m."""
        if position == 0:
            return self.origin
        return self.origin @ joint_motion(self.kind, self.axis, position)


@dataclass(frozen=True, eq=False)
class TreeLink:
    """A link of the tree as it is written."""

    body: Body | None  # its inertial in the link's frame; None where there is none that can be read
    fault: str  # why an inertial cannot be read, else empty
    outline: Array  # corners, in its frame, of the boxes round its shapes, meshes left out, (k, 3)
    bounded: bool  # whether that is all of it: it has shapes, and none is a mesh
    element: ET.Element | None = None  # its XML in a URDF
    # Remarks on what is read otherwise than the file says, each with the link's name.
    doubts: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Standing:
    """Positions of joints that are not free."""

    # By joint, its own position, what it mimics, or 0, as which free joints count; rad or m.
    at: Mapping[str, float]
    faults: Mapping[str, str]  # by follower, why its position is not known
    moved: Mapping[str, str]  # by follower, the free joint that it moves with


@dataclass(frozen=True, eq=False)
class Tree:
    """Links and joints of a robot's file."""

    file: Path  # where it was read
    name: str
    links: Mapping[str, TreeLink]  # by name, in file order
    joints: Mapping[str, TreeJoint]  # by the name of their child link, in file order
    root: str  # the link that no joint moves
    order: tuple[TreeJoint, ...]  # the joints, each behind the one that it hangs on
    foreign: tuple[str, ...]  # what xacro left in the file, such as ``xacro:property``
    format: str = "urdf"  # the key of the format that the file has, see `ROBOT_FORMATS`
    arguments: tuple[tuple[str, str], ...] = ()  # of the .xacro that the file is
    expansion: str = ""  # of the .xacro that the file is, as URDF
    model: Any = None  # a MuJoCo model, compiled; None of a URDF
    # By link that is one, its number in that model.
    bodies: Mapping[str, int] = field(default_factory=dict)
    keyframe: str = ""  # the name of the keyframe that arms start at; empty where there is none
    # Of a MuJoCo model, all its positions there, else those that it is written at, (nq,).
    qpos: Array = field(default_factory=lambda: np.zeros(0))
    addresses: Mapping[str, int] = field(default_factory=dict)  # of the movable joints in them

    @property
    def source(self) -> object:
        """Equal for trees of one file, by one set of arguments."""
        return self.file, self.arguments

    @cached_property
    def movable(self) -> dict[str, TreeJoint]:
        """Joints of one degree of freedom, by name."""
        return {j.name: j for j in self.joints.values() if j.kind in MOVABLE}

    def ancestors(self, link: str) -> list[TreeJoint]:
        """The joints between the root link and a link, nearest the link first."""
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
        """Positions of the movable joints that are not free."""
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
                at[follower] = joint.mimic.at(at.get(leader, 0.0))
                if leader in free or leader in moved:
                    moved[follower] = moved.get(leader, leader)
                if leader in faults or "mimic" in joint.faults:
                    faults[follower] = joint.faults.get("mimic") or faults[leader]
                elif leader and leader not in self.movable:
                    faults[follower] = (
                        f"joint {follower!r} mimics {leader!r}, which is no movable joint of "
                        f"{self.file.name}{nearest(leader, self.movable)}; or lock {follower!r}"
                    )
        return Standing(at, faults, moved)

    def placed(
        self, positions: Mapping[str, float], free: Collection[str] = ()
    ) -> dict[str, tuple[str | None, Pose]]:
        """The free joint that moves each link, and the link's pose in that joint's frame, by
        positions of movable joints, see `Standing`; all others are at rest.

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
        """An error about the robot, with a hint where xacro left something in its file."""
        return InputError(f"{text}; {unexpanded(self.file)}" if self.foreign else text, key=key)


def box_corners(half: Array) -> Array:
    """Corners of a box by half its edges, m, (8, 3)."""
    return np.array(list(itertools.product((-1.0, 1.0), repeat=3))) * half
