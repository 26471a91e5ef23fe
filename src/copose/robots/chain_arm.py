"""Arms from robots' files: the chain root → tip, with everything else lumped into its joints."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce

import numpy as np

from copose.errors import InputError, nearest, together
from copose.poses import Array, Pose, frozen_array
from copose.problem import RobotArm
from copose.robots.arm import Arm, Body, Joint, LockedJoint, freed
from copose.robots.files.tree import MOVABLE, Standing, Tree, TreeJoint
from copose.robots.files.xacro_file import XACRO
from copose.robots.limits import LimitNotes, check_lengths, start_within_limits
from copose.robots.plausibility import inertia_oddities, limit_oddities, negative_inertias
from copose.robots.robot import Robot, RobotOnBase


def robot_arm(spec: RobotArm, robot: Robot, key: str, *, weighed: bool) -> tuple[Arm, RobotOnBase]:
    """The chain root → tip of a robot with every other joint locked; weighed where the inertia of
    its links is needed.

    Raises:
        InputError: the chain cannot be used; the message names the joints and links.
    """
    chain, tree, notes = _Chain.of(spec, robot.tree, key), robot.tree, LimitNotes()
    ranges, weightless = _checked_limits(chain, key, notes, weighed=weighed)
    for joint in chain.free:
        for remark, name in joint.doubts.items():
            notes.note(remark, name)
    for joint in chain.carried:
        for remark, name in tree.links[joint.child].doubts.items():
            notes.note(remark, name)
    joints = tuple(_joint(chain, i, limits, notes) for i, limits in enumerate(ranges))
    start, start_notes = _start(spec, tree, joints, key)
    arm = Arm(
        name=spec.name,
        model=tree.file.name,
        joints=joints,
        base=spec.base.pose,
        tip=chain.placed[spec.tip][1],
        grasp=spec.grasp.pose,
        start=start,
        locked=tuple(
            _locked(joint, chain.standing.at[joint.name])
            for joint in chain.needed
            if joint.kind in MOVABLE and joint.name not in chain.names
        ),
        geared=spec.armature is not None or any(joint.armature for joint in chain.free),
        free=freed(spec),
        fixed=spec.fixed,
        weightless=tuple(weightless),
        notes=(*notes.told(spec.name), *start_notes, *_xacro_notes(tree)),
        oddities=(
            *inertia_oddities(tree, [joint.child for joint in chain.carried]),
            *limit_oddities(joints),
        ),
    )
    return arm, chain.robot_on_base


@dataclass(frozen=True, eq=False)
class _Chain:
    """The joints of an arm and the links that they move."""

    spec: RobotArm  # the ``[[arms]]`` table
    tree: Tree
    root: str  # the first link
    joints: Sequence[TreeJoint]  # from the root to the tip
    free: Sequence[TreeJoint]  # those of them that the arm moves
    standing: Standing  # positions of the other movable joints of the robot
    # Of each link the free joint that moves it and its pose there, see `Tree.placed`.
    placed: Mapping[str, tuple[str | None, Pose]]

    @classmethod
    def of(cls, spec: RobotArm, tree: Tree, key: str, most_free: int = 32) -> _Chain:
        """Follow a chain.

        Args:
            spec: the ``[[arms]]`` table.
            tree: the robot.
            key: of the table, for messages.
            most_free: free joints, as many as a planar arm may have links; the cost of an arm grows
                with the square of it.

        Raises:
            InputError: there is no such chain, or too few or too many of its joints are free.
        """
        root = tree.root if spec.root is None else spec.root
        try:
            joints = tree.chain(root, spec.tip)
        except InputError as error:
            raise InputError(error.message, key=f"{key}.{error.key}") from None
        _check_locked(spec, tree, key)
        free = [j for j in joints if j.kind != "fixed" and not _is_held(j, spec)]
        names = tuple(joint.name for joint in free)
        if not names:
            raise InputError(f"no free joint between {root!r} and {spec.tip!r}", key=key)
        if len(names) > most_free:
            raise InputError(
                f"has {len(names)} free joints; at most {most_free} can be used, lock the others",
                key=f"{key}.locked",
            )
        check_lengths(spec, names, key)
        standing = tree.standing(spec.locked, names)
        return cls(spec, tree, root, joints, free, standing, tree.placed(standing.at, names))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the free joints."""
        return tuple(joint.name for joint in self.free)

    @cached_property
    def carried(self) -> list[TreeJoint]:
        """The joints above the links that the arm moves."""
        return [joint for joint in self.tree.order if self.placed[joint.child][0] is not None]

    @cached_property
    def needed(self) -> list[TreeJoint]:
        """The joints on the chain or carried by it; no others matter to any number."""
        return list(dict.fromkeys((*self.joints, *self.carried)))

    @property
    def robot_on_base(self) -> RobotOnBase:
        """The robot that the arm is part of."""
        return RobotOnBase(
            source=self.tree.source,
            origin=self.spec.base.pose @ self.placed[self.root][1].inverse(),
            hangs_on={
                joint.name: None if joint.name in self.names else self.standing.at[joint.name]
                for joint in reversed(self.tree.ancestors(self.spec.tip))
                if joint.kind in MOVABLE
            },
        )


def _checked_limits(
    chain: _Chain, key: str, notes: LimitNotes, *, weighed: bool
) -> tuple[list[tuple[float, float]], list[str]]:
    """Position limits of the free joints, and why the inertia of what they move is not known.

    Raises:
        InputError: numbers that are needed cannot be read, or make no sense.
    """
    spec, tree = chain.spec, chain.tree
    limits = [_limits(joint, i, spec, notes) for i, joint in enumerate(chain.free)]
    faults = [
        *joint_faults(chain.needed, chain.names, chain.standing),
        *(fault for *_, fault in limits),
    ]
    weightless = _weightless(chain)
    faults += weightless if weighed else []
    if any(faults):
        raise tree.fault(together(fault for fault in faults if fault), key)
    return [(lower, upper) for lower, upper, _ in limits], weightless


def _joint(chain: _Chain, i: int, limits: tuple[float, float], notes: LimitNotes) -> Joint:
    """Free joint i with everything that it carries, up to the next."""
    spec, joint = chain.spec, chain.free[i]
    place = chain.placed[joint.parent][1] @ joint.origin
    if i == 0:
        place = chain.placed[chain.root][1].inverse() @ place
    body = _body(chain, joint)
    if spec.tool is not None and i + 1 == len(chain.free):
        tool = Body(spec.tool.mass, frozen_array(spec.tool.com), frozen_array(spec.tool.inertia))
        body = body + tool.placed(chain.placed[spec.tip][1])
    return Joint(
        name=joint.name,
        kind="prismatic" if joint.kind == "prismatic" else "revolute",
        axis=joint.axis,
        placement=place,
        body=body,
        lower=limits[0],
        upper=limits[1],
        velocity=_positive(joint, "velocity", i, spec.velocity_limits, notes),
        acceleration=spec.acceleration_limits[i] if spec.acceleration_limits else np.inf,
        effort=_positive(joint, "effort", i, spec.torque_limits, notes),
        armature=spec.armature[i] if spec.armature else joint.armature,
    )


def _start(
    spec: RobotArm, tree: Tree, joints: tuple[Joint, ...], key: str
) -> tuple[Array | None, tuple[str, ...]]:
    """The start that the problem gives, else that of the robot's file, else None; and notes."""
    start = start_within_limits(spec, joints, key)
    if start is None and tree.keyframe:
        return _at_keyframe(spec, tree, joints)
    return start, ()


def _xacro_notes(tree: Tree) -> Iterator[str]:
    """Notes on what xacro has done to the robot's file, or has left in it."""
    if tree.file.suffix == XACRO:
        yield f"{tree.file.name} was run by xacro"
    if tree.foreign:
        names = ", ".join(tree.foreign)
        yield f"{tree.file.name}: what xacro left in it is passed over: {names}"


def _at_keyframe(
    spec: RobotArm, tree: Tree, joints: Sequence[Joint], rounding: float = 1e-6
) -> tuple[Array | None, tuple[str, ...]]:
    """The start in a robot's file, or None where it exceeds the limits by more than rounding, rad
    or m; and a note.
    """
    q = np.array([tree.qpos[tree.addresses[joint.name]] for joint in joints])
    low, high = np.array([(joint.lower, joint.upper) for joint in joints]).T
    where = f"keyframe {tree.keyframe!r} of {tree.file.name}"
    outside = [j.name for j, x in zip(joints, q, strict=True) if not j.lower <= x <= j.upper]
    if np.any((q < low - rounding) | (q > high + rounding)):
        text = f"arm {spec.name!r}: {where} is no start: outside the limits of {', '.join(outside)}"
        return None, (text,)
    return frozen_array(np.clip(q, low, high)), (f"{where} is the start of arm {spec.name!r}",)


def _is_held(joint: TreeJoint, spec: RobotArm) -> bool:
    """True for a joint of the chain that is locked, or that follows another and so is not free."""
    return joint.name in spec.locked or (joint.kind in MOVABLE and joint.mimic is not None)


def _check_locked(spec: RobotArm, tree: Tree, key: str) -> None:
    for name in spec.locked:
        if name not in tree.movable:
            raise InputError(
                f"{name!r} is no movable joint of {tree.file.name}{nearest(name, tree.movable)}",
                key=f"{key}.locked",
            )


def joint_faults(
    needed: Sequence[TreeJoint], free: Collection[str], standing: Standing
) -> Iterator[str]:
    """Reasons why joints that are needed cannot be placed or be free; some are empty."""
    for joint in needed:
        if joint.name in free and joint.kind not in MOVABLE:
            yield (
                f"joint {joint.name!r} on the chain is {joint.kind or 'untyped'}; revolute, "
                "continuous and prismatic joints can be used"
            )
        yield joint.faults.get("origin", "")
        if joint.name in free:
            yield joint.faults.get("drive", "")
        if joint.name in free or standing.at.get(joint.name):
            yield joint.faults.get("axis", "")
        yield standing.faults.get(joint.name, "")
    for follower, leader in standing.moved.items():
        yield (
            f"joint {follower!r} mimics {leader!r}, which is free; lock one of them, or choose "
            "another tip"
        )


def _weightless(chain: _Chain) -> list[str]:
    """Reasons why the inertia of what an arm moves is not known."""
    tree, carried = chain.tree, chain.carried
    links = [tree.links[joint.child] for joint in carried]
    faults = [link.fault for link in links if link.fault]
    faults += negative_inertias(tree, [joint.child for joint in carried])
    bodies = [link.body for link in links if link.body is not None]
    if not faults and chain.spec.tool is None and not any(body.mass > 0 for body in bodies):
        named = ", ".join(joint.child for joint in chain.free)
        faults.append(f"{tree.file.name} has no inertials: none of {named} has a mass")
    return faults


def _body(chain: _Chain, joint: TreeJoint) -> Body:
    """All that a free joint carries and no joint behind it, as one body in the joint's frame."""
    bodies = [
        body.placed(pose)
        for link, (carrier, pose) in chain.placed.items()
        if carrier == joint.name and (body := chain.tree.links[link].body) is not None
    ]
    massless = Body(0.0, frozen_array(np.zeros(3)), frozen_array(np.zeros((3, 3))))
    return reduce(Body.__add__, bodies) if bodies else massless


def _locked(joint: TreeJoint, position: float) -> LockedJoint:
    limits = joint.lower, joint.upper
    if joint.kind == "continuous" or "limit" in joint.faults:
        limits = -np.inf, np.inf
    return LockedJoint(joint.name, position, *limits)


def _positive(
    joint: TreeJoint, what: str, i: int, given: Sequence[float] | None, notes: LimitNotes
) -> float:
    """The limit of effort or velocity of a free joint, infinite where it has none."""
    if given is not None:
        return given[i]
    return notes.positive(what, joint.name, getattr(joint, what), joint.faults.get(what, ""))


def _limits(
    joint: TreeJoint, i: int, spec: RobotArm, notes: LimitNotes
) -> tuple[float, float, str]:
    """Lower and upper limit of a free joint, and why they cannot be used, else an empty text."""
    if spec.position_limits is not None:
        given = spec.position_limits[i]
    elif joint.kind == "continuous":
        return -np.inf, np.inf, ""
    elif "limit" in joint.faults:
        return 0.0, 0.0, joint.faults["limit"] + "; correct it, or give position_limits"
    elif not joint.lower < joint.upper:
        span = f"{joint.lower:g} … {joint.upper:g}"
        fault = f"joint {joint.name!r} has no range in the URDF ({span}); give position_limits"
        return 0.0, 0.0, f"{fault}, or lock it"
    else:
        given = joint.lower, joint.upper
    lower, upper = notes.positions(joint.name, given)
    unlimited = joint.kind == "prismatic" and not np.isfinite([lower, upper]).all()
    fault = f"prismatic joint {joint.name!r} needs position_limits below 1e6" if unlimited else ""
    return lower, upper, fault
