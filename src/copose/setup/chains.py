"""Arms in the tree of a robot's joints: their branches, tips, and locked joints."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

from copose.robots.files.tree import MOVABLE, Tree, TreeJoint


@dataclass(frozen=True)
class ChainOptions:
    """Sizes and words by which arms are told from legs, heads and fingers.

    Words are those of names of joints and links, see `words`.
    """

    fewest: int = 3  # joints of an arm
    above_hand: int = 4  # joints above a hand of several fingers, at least
    finger: int = 4  # joints of the longest finger
    plenty: int = 6  # joints that an arm keeps where one is locked by its name alone
    endless: float = 1e6  # range that is none, rad or m
    legs: frozenset[str] = frozenset({
        "leg", "hip", "knee", "ankle", "foot", "thigh", "calf", "shank", "toe", "haa", "hfe", "kfe",
        "wheel", "caster", "rotor", "propeller",
    })  # fmt: skip
    heads: frozenset[str] = frozenset({
        "head", "neck", "eye", "eyes", "ear", "ears", "camera", "laser", "lidar", "antenna",
    })  # fmt: skip
    fingers: frozenset[str] = frozenset({
        "finger", "fingers", "thumb", "index", "pinky", "knuckle", "jaw", "claw", "fingertip",
    })  # fmt: skip
    # A link of that name may be the whole gripper, but a joint of that name opens it.
    grippers: frozenset[str] = frozenset({"gripper", "grip"})
    trunk: frozenset[str] = frozenset({"torso", "waist", "trunk", "chest", "spine", "lumbar"})
    no_tip: frozenset[str] = frozenset({
        "camera", "sensor", "imu", "ft", "force", "optical", "inertia", "inertial", "com",
        "collision", "cover",
    })  # fmt: skip
    # Names of frames to grasp with, the best first.
    tips: tuple[frozenset[str], ...] = (
        frozenset({"tcp", "tool0", "tool", "grasping", "grasp"}),
        frozenset({"ee", "eef", "effector", "endeffector"}),
        frozenset({"palm", "hand", "gripper"}),
        frozenset({"flange"}),
    )


@dataclass(frozen=True, eq=False)
class ArmChain:
    """An arm of a robot's tree."""

    tree: Tree
    # The link that it stands on; its own root but where a joint that cannot be used is above.
    root: str
    tip: str  # the link that grasps
    why: str  # how the tip was found
    joints: tuple[TreeJoint, ...]  # free ones, root to tip
    # Joints above the tip that are held, with the position, rad or m, and why.
    locked: tuple[tuple[TreeJoint, float, str], ...]

    @cached_property
    def side(self) -> str:
        """The side of the arm, ``left`` or ``right``, by its names, else empty."""
        for side in ("left", "right"):
            named = [_says(side, joint.name, joint.child) for joint in self.joints]
            if sum(named) > len(named) / 2 or _says(side, self.tip):
                return side
        return ""


def words(name: str) -> list[str]:
    """The words of a name, ``LHipYaw`` or ``l_hip_yaw``, in small letters."""
    return [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name)]


def _says(side: str, *names: str) -> bool:
    """True if a word of some names is a side or its first letter."""
    return any(word in (side, side[0]) for name in names for word in words(name))


def find_chains(
    tree: Tree, named: Collection[str] = (), options: ChainOptions = ChainOptions()
) -> list[ArmChain]:
    """The arms of a robot, in file order, without legs, heads, fingers and wheels."""
    branches = _Branches(tree, options)
    ends = branches.ends
    shared = {
        joint.name
        for joint in (joint for path in ends for joint in path)
        if sum(joint in path for path in ends) > 1
    }
    chains = []
    for path in ends:
        own = [joint for joint in path if joint.name not in shared]
        if len(own) < options.fewest or _named(own, options.legs) or _named(own, options.heads):
            continue
        tip, why = _tip(tree, own[-1], named, options)
        chains.append(_chain(tree, tip, why, shared, options))
    return chains


def chain_to(
    tree: Tree, tip: str, other_tips: Sequence[str] = (), options: ChainOptions = ChainOptions()
) -> ArmChain:
    """The arm that ends in a link; joints that it shares with the robot's other tips are locked.

    Raises:
        InputError: there is no such link.
    """
    tree.chain(tree.root, tip)
    ends = [*_Branches(tree, options).ends]
    ends += [tuple(tree.ancestors(other_tip)) for other_tip in other_tips if other_tip != tip]
    above = [joint.name for joint in tree.ancestors(tip)]
    kept: list[set[str]] = [{joint.name for joint in path} for path in ends]
    # The branch that the arm itself is part of shares nothing with it.
    longest = max((sum(name in path for name in above) for path in kept), default=0)
    kept = [path for path in kept if sum(name in path for name in above) < longest]
    kept += [
        {joint.name for joint in tree.ancestors(other_tip)}
        for other_tip in other_tips
        if other_tip != tip
    ]
    shared = {name for name in above if any(name in path for path in kept)}
    return _chain(tree, tip, "as asked", shared, options)


@dataclass(frozen=True, eq=False)
class _Branches:
    """Branches of the free joints of a tree, without fingers."""

    tree: Tree
    options: ChainOptions

    @cached_property
    def fingers(self) -> set[str]:
        """Names of the joints that follow others, lead them, or are called fingers."""
        movable = self.tree.movable.values()
        leaders = {joint.mimic.leader for joint in movable if joint.mimic}
        called = {joint.name for joint in movable if _is_finger(joint, self.options)}
        if len(called) == len(movable):
            return leaders | {joint.name for joint in movable if joint.mimic}
        # What hangs on one palm with a finger is one.
        palms = {self.body[joint.parent] for joint in movable if joint.name in called}
        called |= {joint.name for joint in movable if self.body[joint.parent] in palms}
        return called | leaders | {joint.name for joint in movable if joint.mimic}

    @cached_property
    def body(self) -> dict[str, str]:
        """The uppermost link of the rigid body that each link is part of, by link."""
        bodies = {self.tree.root: self.tree.root}
        for joint in self.tree.order:
            bodies[joint.child] = bodies[joint.parent] if joint.kind == "fixed" else joint.child
        return bodies

    @cached_property
    def above(self) -> dict[str, tuple[TreeJoint, ...] | None]:
        """Free joints above each link, from the root; None of links that fingers move."""
        paths: dict[str, tuple[TreeJoint, ...] | None] = {self.tree.root: ()}
        for joint in self.tree.order:
            path = paths[joint.parent]
            if path is not None and joint.kind in MOVABLE:
                path = None if joint.name in self.fingers else (*path, joint)
            elif path is not None and joint.kind != "fixed":
                path = ()
            paths[joint.child] = path
        return paths

    @cached_property
    def ends(self) -> list[tuple[TreeJoint, ...]]:
        """Joints from the root to the end of every branch, in file order."""
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
            short = all(length[name] <= self.options.finger for name in after)
            if len(after) > 1 and short and len(path) >= self.options.above_hand:
                cut |= after
        kept = {
            path[-1].name: path for path in paths if not any(joint.name in cut for joint in path)
        }
        inner = {path[-2].name for path in kept.values() if len(path) > 1}
        return [path for name, path in kept.items() if name not in inner]


def _chain(
    tree: Tree, tip: str, why: str, shared: Collection[str], options: ChainOptions
) -> ArmChain:
    """The arm to a tip; joints that are shared, of the trunk, or without a range are locked."""
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
        left = len(movable) - len(locked)
        if joint.name in shared:
            text = "it moves more than this arm"
        elif only_locked and _named([joint], options.trunk) and left > options.plenty:
            text = "it moves the trunk"
        elif joint.kind != "continuous" and not joint.lower < joint.upper:
            text = "it has no range"
        elif joint.kind == "prismatic" and joint.upper - joint.lower >= options.endless:
            text = "it has no limits"
        if text:
            locked.append((joint, _middle(joint, options.endless), text))
    held = {joint.name for joint, *_ in locked}
    free = tuple(joint for joint in movable if joint.name not in held)
    names = [joint.name for joint in free]
    placed = tree.placed({}, names)
    for follower in tree.standing(dict.fromkeys(held, 0.0), names).faults:
        joint = tree.movable[follower]
        if joint in path or placed[joint.child][0] is not None:
            locked.append((joint, 0.0, "what it should follow is missing"))
    return ArmChain(tree, root, tip, why, free, tuple(locked))


def _middle(joint: TreeJoint, endless: float) -> float:
    """Position of a locked joint: upright if its range allows; else, or of a lift, the middle."""
    if joint.kind == "continuous" or joint.upper - joint.lower >= endless:
        return 0.0
    if joint.kind == "revolute" and joint.lower <= 0 <= joint.upper:
        return 0.0
    return round((joint.lower + joint.upper) / 2, 4) + 0.0


def _tip(
    tree: Tree, last: TreeJoint, named: Collection[str], options: ChainOptions
) -> tuple[str, str]:
    """The link to grasp with behind an arm's last joint, and how it was found."""
    # Links of the rigid body that the joint moves, and those of them that fingers hang on.
    body = [last.child]
    for joint in tree.order:
        if joint.parent in body and joint.kind == "fixed":
            body.append(joint.child)
    hands = [joint.parent for joint in tree.order if joint.parent in body and joint.kind in MOVABLE]
    for link in reversed(body):
        if link in named:
            return link, "as the SRDF names it"
    fit = [link for link in body if not options.no_tip.intersection(words(link))] or body
    for link in fit:
        if options.tips[0].intersection(words(link)):
            return link, "by its name"
    if hands:
        return hands[-1], "the last link before the fingers"
    for called in options.tips[1:]:
        for link in reversed(fit):
            if called.intersection(words(link)):
                return link, "by its name"
    return fit[-1] if fit[-1] in _leaves(tree, fit) else fit[0], "the end of its branch"


def _leaves(tree: Tree, links: Iterable[str]) -> list[str]:
    """Links that no joint hangs on."""
    parents = {joint.parent for joint in tree.joints.values()}
    return [link for link in links if link not in parents]


def _is_finger(joint: TreeJoint, options: ChainOptions) -> bool:
    """True if a joint moves a finger or opens a gripper, by its names."""
    named = options.grippers.intersection(words(joint.name))
    return _named([joint], options.fingers) or bool(named)


def _named(joints: Iterable[TreeJoint], called: Collection[str]) -> bool:
    """True if the name of a joint, or of the link that it moves, has one of some words."""
    return any(
        word in called
        for joint in joints
        for name in (joint.name, joint.child)
        for word in words(name)
    )
