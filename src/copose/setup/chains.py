"""The arms in a robot's tree: which branches are arms, where they end, and what they share."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

from copose.robots.files.tree import MOVABLE, Tree, TreeJoint

# Joints that an arm has at least, and those above a hand of several fingers.
FEWEST = 3
_ABOVE_HAND = 4
# Joints that the longest finger has.
_FINGER = 4
# What an arm must keep for a joint to be locked by its name alone.
_PLENTY = 6
# A range that is none, rad or m.
_ENDLESS = 1e6

_LEGS = {
    "leg", "hip", "knee", "ankle", "foot", "thigh", "calf", "shank", "toe", "haa", "hfe", "kfe",
    "wheel", "caster", "rotor", "propeller",
}  # fmt: skip
_HEADS = {"head", "neck", "eye", "eyes", "ear", "ears", "camera", "laser", "lidar", "antenna"}
_FINGERS = {"finger", "fingers", "thumb", "index", "pinky", "knuckle", "jaw", "claw", "fingertip"}
# A link of that name may be the whole gripper, but a joint of that name opens it.
_OPENS = {"gripper", "grip"}
_TRUNK = {"torso", "waist", "trunk", "chest", "spine", "lumbar"}
_NO_TIP = {
    "camera", "sensor", "imu", "ft", "force", "optical", "inertia", "inertial", "com", "collision",
    "cover",
}  # fmt: skip
# Names of frames to grasp with, the best first.
_TIPS = (
    {"tcp", "tool0", "tool", "grasping", "grasp"},
    {"ee", "eef", "effector", "endeffector"},
    {"palm", "hand", "gripper"},
    {"flange"},
)


@dataclass(frozen=True, eq=False)
class Chain:
    """An arm of a robot's tree.

    Attributes:
        tree: the robot's.
        root: the link that it stands on; its own root but where a joint that cannot be used is
            above.
        tip: the link that grasps.
        why: how the tip was found.
        joints: free ones, root to tip.
        locked: joints above the tip that are held, with the position, rad or m, and why.
    """

    tree: Tree
    root: str
    tip: str
    why: str
    joints: tuple[TreeJoint, ...]
    locked: tuple[tuple[TreeJoint, float, str], ...]

    @cached_property
    def side(self) -> str:
        """``left`` or ``right`` where names say so, else empty."""
        for side in ("left", "right"):
            named = [_says(side, joint.name, joint.child) for joint in self.joints]
            if sum(named) > len(named) / 2 or _says(side, self.tip):
                return side
        return ""


def words(name: str) -> list[str]:
    """The words of a name, ``LHipYaw`` or ``l_hip_yaw``, in small letters."""
    return [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name)]


def _says(side: str, *names: str) -> bool:
    return any(word in (side, side[0]) for name in names for word in words(name))


def find_chains(tree: Tree, named: Collection[str] = ()) -> list[Chain]:
    """The arms of a robot, in file order; legs, heads, fingers and wheels are none.

    Args:
        tree: the robot's.
        named: links that somebody calls tips.
    """
    branches = _Branches(tree)
    ends = branches.ends
    shared = {
        joint.name
        for joint in (joint for path in ends for joint in path)
        if sum(joint in path for path in ends) > 1
    }
    found = []
    for path in ends:
        own = [joint for joint in path if joint.name not in shared]
        if len(own) < FEWEST or _named(own, _LEGS) or _named(own, _HEADS):
            continue
        tip, why = _tip(tree, branches, own[-1], named)
        found.append(_chain(tree, tip, why, shared))
    return found


def chain_to(tree: Tree, tip: str, others: Sequence[str] = ()) -> Chain:
    """The arm that ends in a link.

    Args:
        tree: the robot's.
        tip: its link.
        others: tips of the robot's other arms: what they share is locked.

    Raises:
        InputError: there is no such link.
    """
    tree.chain(tree.root, tip)
    ends = [*_Branches(tree).ends, *(tree.ancestors(other) for other in others if other != tip)]
    mine = [joint.name for joint in tree.ancestors(tip)]
    kept: list[set[str]] = [{joint.name for joint in path} for path in ends]
    # The branch that the arm itself is part of shares nothing with it.
    longest = max((sum(name in path for name in mine) for path in kept), default=0)
    kept = [path for path in kept if sum(name in path for name in mine) < longest]
    kept += [{joint.name for joint in tree.ancestors(other)} for other in others if other != tip]
    shared = {name for name in mine if any(name in path for path in kept)}
    return _chain(tree, tip, "as asked", shared)


@dataclass(frozen=True, eq=False)
class _Branches:
    """A tree's free joints without fingers."""

    tree: Tree

    @cached_property
    def fingers(self) -> set[str]:
        """Joints that follow others, lead them, or are called fingers."""
        movable = self.tree.movable.values()
        leaders = {joint.mimic.leader for joint in movable if joint.mimic}
        called = {joint.name for joint in movable if _is_finger(joint)}
        if len(called) == len(movable):
            return leaders | {joint.name for joint in movable if joint.mimic}
        # What hangs on one palm with a finger is one.
        palms = {self.body[joint.parent] for joint in movable if joint.name in called}
        called |= {joint.name for joint in movable if self.body[joint.parent] in palms}
        return called | leaders | {joint.name for joint in movable if joint.mimic}

    @cached_property
    def body(self) -> dict[str, str]:
        """By link the uppermost link that fixed joints alone tie it to."""
        found = {self.tree.root: self.tree.root}
        for joint in self.tree.order:
            found[joint.child] = found[joint.parent] if joint.kind == "fixed" else joint.child
        return found

    @cached_property
    def above(self) -> dict[str, tuple[TreeJoint, ...] | None]:
        """By link the free joints above it, from the root; None of what fingers move."""
        found: dict[str, tuple[TreeJoint, ...] | None] = {self.tree.root: ()}
        for joint in self.tree.order:
            path = found[joint.parent]
            if path is not None and joint.kind in MOVABLE:
                path = None if joint.name in self.fingers else (*path, joint)
            elif path is not None and joint.kind != "fixed":
                path = ()
            found[joint.child] = path
        return found

    @cached_property
    def ends(self) -> list[tuple[TreeJoint, ...]]:
        """Ways from the root to the last joint of every branch, in file order."""
        paths = [path for path in self.above.values() if path]
        behind: dict[str, set[str]] = {}
        length: dict[str, int] = {}
        for path in sorted(paths, key=len, reverse=True):
            last = path[-1].name
            length.setdefault(last, 1)
            if len(path) > 1:
                before = path[-2].name
                behind.setdefault(before, set()).add(last)
                length[before] = max(length.get(before, 1), 1 + length[last])
        cut: set[str] = set()
        for path in paths:
            after = behind.get(path[-1].name, set())
            short = all(length[name] <= _FINGER for name in after)
            if len(after) > 1 and short and len(path) >= _ABOVE_HAND:
                cut |= after
        kept = {
            path[-1].name: path for path in paths if not any(joint.name in cut for joint in path)
        }
        inner = {path[-2].name for path in kept.values() if len(path) > 1}
        return [path for name, path in kept.items() if name not in inner]


def _chain(tree: Tree, tip: str, why: str, shared: Collection[str]) -> Chain:
    path = tree.ancestors(tip)[::-1]
    root = tree.root
    for joint in path:
        if joint.kind not in (*MOVABLE, "fixed"):
            root = joint.child
    path = tree.chain(root, tip)
    movable = [joint for joint in path if joint.kind in MOVABLE and not joint.mimic]
    locked: list[tuple[TreeJoint, float, str]] = []
    for joint in movable:
        text, only_locked = "", len(locked) == movable.index(joint)
        if joint.name in shared:
            text = "it moves more than this arm"
        elif _named([joint], _TRUNK) and len(movable) - len(locked) > _PLENTY and only_locked:
            text = "it moves the trunk"
        elif joint.kind != "continuous" and not joint.lower < joint.upper:
            text = "it has no range"
        elif joint.kind == "prismatic" and joint.upper - joint.lower >= _ENDLESS:
            text = "it has no limits"
        if text:
            locked.append((joint, _middle(joint), text))
    held = {joint.name for joint, *_ in locked}
    free = tuple(joint for joint in movable if joint.name not in held)
    names = [joint.name for joint in free]
    placed = tree.placed({}, names)
    for follower in tree.standing(dict.fromkeys(held, 0.0), names).faults:
        joint = tree.movable[follower]
        if joint in path or placed[joint.child][0] is not None:
            locked.append((joint, 0.0, "what it should follow is missing"))
    return Chain(tree, root, tip, why, free, tuple(locked))


def _middle(joint: TreeJoint) -> float:
    """Upright where that is within a joint's range, else, and of a lift, its middle."""
    if joint.kind == "continuous" or joint.upper - joint.lower >= _ENDLESS:
        return 0.0
    if joint.kind == "revolute" and joint.lower <= 0 <= joint.upper:
        return 0.0
    return round((joint.lower + joint.upper) / 2, 4) + 0.0


def _tip(
    tree: Tree, branches: _Branches, last: TreeJoint, named: Collection[str]
) -> tuple[str, str]:
    """The link behind an arm's last joint to grasp with, and how it was found."""
    # Links of one rigid body with what the joint moves, and those of them that fingers hang on.
    body = [last.child]
    for joint in tree.order:
        if joint.parent in body and joint.kind == "fixed":
            body.append(joint.child)
    hands = [joint.parent for joint in tree.order if joint.parent in body and joint.kind in MOVABLE]
    for link in reversed(body):
        if link in named:
            return link, "as the SRDF names it"
    fit = [link for link in body if not _NO_TIP.intersection(words(link))] or body
    for link in fit:
        if _TIPS[0].intersection(words(link)):
            return link, "by its name"
    if hands:
        return hands[-1], "the last link before the fingers"
    for called in _TIPS[1:]:
        for link in reversed(fit):
            if called.intersection(words(link)):
                return link, "by its name"
    return fit[-1] if fit[-1] in _leaves(tree, fit) else fit[0], "the end of its branch"


def _leaves(tree: Tree, links: Iterable[str]) -> list[str]:
    parents = {joint.parent for joint in tree.joints.values()}
    return [link for link in links if link not in parents]


def _is_finger(joint: TreeJoint) -> bool:
    return _named([joint], _FINGERS) or bool(_OPENS.intersection(words(joint.name)))


def _named(joints: Iterable[TreeJoint], called: Collection[str]) -> bool:
    """Whether a joint or the link that it moves bears one of some words."""
    return any(
        word in called
        for joint in joints
        for name in (joint.name, joint.child)
        for word in words(name)
    )
