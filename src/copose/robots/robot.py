"""Arms from robots' files: the chain root → tip, with everything else lumped into its joints."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from pathlib import Path
from typing import TypeAlias

import numpy as np

from copose.errors import InputError, nearest, shown, together
from copose.poses import Array, Pose, frozen_array
from copose.problem import RobotArm
from copose.robots.arm import (
    Arm,
    Body,
    Doubts,
    Joint,
    LockedJoint,
    check_lengths,
    freed,
    start_within_limits,
)
from copose.robots.mjcf_tree import read_mjcf
from copose.robots.paths import resolve
from copose.robots.plausibility import inertia_oddities, limit_oddities, negative_inertias
from copose.robots.tree import MOVABLE, Standing, Tree, TreeJoint
from copose.robots.urdf_tree import read_tree
from copose.robots.xacro_file import XACRO

# As many as a planar arm may have links; what an arm costs grows with the square of it.
_MOST_FREE = 32
# What a position of a file may be off a limit of it, rad or m.
_ROUNDING = 1e-6
_MASSLESS = Body(0.0, frozen_array(np.zeros(3)), frozen_array(np.zeros((3, 3))))


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot's file, read, and the folders of the packages that it may name."""

    tree: Tree
    packages: Mapping[str, Path]


RobotsRead: TypeAlias = dict[object, Robot]


@dataclass(frozen=True, eq=False)
class RobotOnBase:
    """Which robot an arm is part of, to tell whether two arms move independently.

    Attributes:
        source: its file, with the arguments of xacro.
        origin: T_world_universe of the whole robot.
        hangs_on: the movable joints above the tip, from its root link: where a locked one is
            held, None where the arm moves it.
    """

    source: object
    origin: Pose
    hangs_on: Mapping[str, float | None]

    def same(self, other: RobotOnBase) -> bool:
        """Whether the two arms are parts of one robot: one file at one base."""
        return self.source == other.source and np.allclose(
            np.column_stack([self.origin.rotation, self.origin.position]),
            np.column_stack([other.origin.rotation, other.origin.position]),
            rtol=0,
            atol=1e-9,
        )

    def clash(self, other: RobotOnBase) -> str | None:
        """Why the two arms cannot be parts of one robot that move independently."""
        if not self.same(other):
            return None
        common = {
            joint: (position, other.hangs_on[joint])
            for joint, position in self.hangs_on.items()
            if joint in other.hangs_on
        }
        moved = [joint for joint, both in common.items() if None in both]
        if moved:
            at = {
                joint: next((position for position in both if position is not None), 0.0)
                for joint, both in common.items()
                if both[0] is None or both[0] != both[1]
            }
            locked = ", ".join(f"{_toml_key(joint)} = {position}" for joint, position in at.items())
            return (
                f"both hang on {', '.join(moved)}, and so are not independent; lock in both, where "
                f"you want: locked = {{ {locked} }}"
            )
        for joint, (here, there) in common.items():
            if here != there:
                return (
                    f"hold joint {joint!r} at different positions, {here:g} and {there:g}; lock it "
                    "at one"
                )
        return None


def read_robot(spec: RobotArm, folder: Path, key: str, read: RobotsRead) -> Robot:
    """The robot of an arm's file, read once per file and folders of packages.

    Args:
        spec: the ``[[arms]]`` table.
        folder: the problem file's, where relative paths start.
        key: of the table, for messages.
        read: robots already read; grows.

    Raises:
        InputError: the file is missing or cannot be used.
    """
    packages = {
        name: _package_folder(place, folder, f"{key}.packages.{name}")
        for name, place in spec.packages.items()
    }
    try:
        file = resolve(spec.file, folder, packages).resolve()
        arguments = {name: _xacro_text(value) for name, value in spec.xacro_args.items()}
        if arguments and file.suffix != XACRO:
            raise InputError(f"xacro_args have no effect: {file.name} is no {XACRO}")
        kind = (
            spec.kind, file, tuple(sorted(packages.items())), tuple(sorted(arguments.items())),
        )  # fmt: skip
        if kind not in read:
            mjcf = spec.mjcf is not None
            tree = read_mjcf(file) if mjcf else read_tree(file, packages, arguments)
            read[kind] = Robot(tree, packages)
        return read[kind]
    except InputError as error:
        text = f"{error.file}: {error.message}" if error.file else error.message
        raise InputError(text, key=f"{key}.{spec.kind}") from None
    except (OSError, ValueError, RuntimeError) as error:
        # What pathlib makes of unknown users, zero bytes, endless names and circular links.
        text = f"{shown(spec.file)} is no usable path: {error}"
        raise InputError(text, key=f"{key}.{spec.kind}") from None


def robot_arm(spec: RobotArm, robot: Robot, key: str, *, weighed: bool) -> tuple[Arm, RobotOnBase]:
    """The chain root → tip of a robot with every other joint locked.

    Args:
        spec: the ``[[arms]]`` table.
        robot: what its file says.
        key: of the table, for messages.
        weighed: whether the inertia of its links is needed.

    Raises:
        InputError: the chain cannot be used; the message names the joints and links.
    """
    tree = robot.tree
    root = tree.root if spec.root is None else spec.root
    try:
        chain = tree.chain(root, spec.tip)
    except InputError as error:
        raise InputError(error.message, key=f"{key}.{error.key}") from None
    _check_locked(spec, tree, key)
    free = [j for j in chain if j.kind != "fixed" and not _is_held(j, spec)]
    names = tuple(joint.name for joint in free)
    if not names:
        raise InputError(f"no free joint between {root!r} and {spec.tip!r}", key=key)
    if len(names) > _MOST_FREE:
        raise InputError(
            f"has {len(names)} free joints; at most {_MOST_FREE} can be used, lock the others",
            key=f"{key}.locked",
        )
    check_lengths(spec, names, key)

    standing = tree.standing(spec.locked, names)
    placed = tree.placed(standing.at, names)
    carried = [joint for joint in tree.order if placed[joint.child][0] is not None]
    # What is neither on the chain nor carried by it matters to no number.
    needed = list(dict.fromkeys((*chain, *carried)))
    doubts = Doubts()
    ranges = [_limits(joint, i, spec, doubts) for i, joint in enumerate(free)]
    faults = [*joint_faults(needed, names, standing), *(fault for *_, fault in ranges)]
    weightless = _weightless(tree, carried, free, spec)
    faults += weightless if weighed else []
    if any(faults):
        raise tree.fault(together(fault for fault in faults if fault), key)

    for what, text in (each for joint in free for each in joint.doubts.items()):
        doubts.note(what, text)
    for joint in carried:
        for what, text in tree.links[joint.child].doubts.items():
            doubts.note(what, text)

    T_universe_root, tip = placed[root][1], placed[spec.tip][1]
    joints = []
    for i, (joint, (lower, upper, _)) in enumerate(zip(free, ranges, strict=True)):
        place = placed[joint.parent][1] @ joint.origin
        body = _body(tree, placed, joint)
        if spec.tool is not None and i + 1 == len(free):
            tool = Body(
                spec.tool.mass, frozen_array(spec.tool.com), frozen_array(spec.tool.inertia)
            )
            body = body + tool.placed(tip)
        joints.append(
            Joint(
                name=joint.name,
                kind="prismatic" if joint.kind == "prismatic" else "revolute",
                axis=joint.axis,
                placement=place if i > 0 else T_universe_root.inverse() @ place,
                body=body,
                lower=lower,
                upper=upper,
                velocity=_positive(joint, "velocity", i, spec.velocity_limits, doubts),
                acceleration=spec.acceleration_limits[i] if spec.acceleration_limits else np.inf,
                effort=_positive(joint, "effort", i, spec.torque_limits, doubts),
                armature=spec.armature[i] if spec.armature else joint.armature,
            )
        )
    base = spec.base.pose
    passed_over = (
        f"{tree.file.name}: what xacro left in it is passed over: {', '.join(tree.foreign)}"
    )
    start = start_within_limits(spec, tuple(joints), key)
    said: tuple[str, ...] = ()
    if start is None and tree.keyframe:
        start, said = _at_keyframe(spec, tree, joints)
    arm = Arm(
        name=spec.name,
        model=tree.file.name,
        joints=tuple(joints),
        base=base,
        tip=tip,
        grasp=spec.grasp.pose,
        start=start,
        locked=tuple(
            _locked(joint, standing.at[joint.name])
            for joint in needed
            if joint.kind in MOVABLE and joint.name not in names
        ),
        geared=spec.armature is not None or any(joint.armature for joint in free),
        free=freed(spec),
        fixed=spec.fixed,
        weightless=tuple(weightless),
        notes=(
            *doubts.told(spec.name),
            *said,
            *([f"{tree.file.name} was run by xacro"] if tree.file.suffix == XACRO else []),
            *([passed_over] if tree.foreign else []),
        ),
        oddities=(
            *inertia_oddities(tree, [joint.child for joint in carried]),
            *limit_oddities(joints),
        ),
    )
    whole = RobotOnBase(
        source=tree.source,
        origin=base @ T_universe_root.inverse(),
        hangs_on={
            joint.name: None if joint.name in names else standing.at[joint.name]
            for joint in reversed(tree.ancestors(spec.tip))
            if joint.kind in MOVABLE
        },
    )
    return arm, whole


def _at_keyframe(
    spec: RobotArm, tree: Tree, joints: Sequence[Joint]
) -> tuple[Array | None, tuple[str, ...]]:
    """The start that a robot's file has, or None where it is outside the limits; and a note."""
    q = np.array([tree.qpos[tree.addresses[joint.name]] for joint in joints])
    low, high = np.array([(joint.lower, joint.upper) for joint in joints]).T
    where = f"keyframe {tree.keyframe!r} of {tree.file.name}"
    outside = [j.name for j, x in zip(joints, q, strict=True) if not j.lower <= x <= j.upper]
    if np.any((q < low - _ROUNDING) | (q > high + _ROUNDING)):
        text = f"arm {spec.name!r}: {where} is no start: outside the limits of {', '.join(outside)}"
        return None, (text,)
    return frozen_array(np.clip(q, low, high)), (f"{where} is the start of arm {spec.name!r}",)


def _package_folder(place: str, folder: Path, key: str) -> Path:
    try:
        return (folder / Path(place).expanduser()).resolve()
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError(f"{shown(place)} is no usable path: {error}", key=key) from None


def _xacro_text(value: str | bool | int | float) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _is_held(joint: TreeJoint, spec: RobotArm) -> bool:
    """Whether a joint of the chain stands still, or must, because it follows another."""
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
    """What keeps joints that are needed from being placed, or from being free; or nothing."""
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


def _weightless(
    tree: Tree, carried: Sequence[TreeJoint], free: Sequence[TreeJoint], spec: RobotArm
) -> list[str]:
    """Why the inertia of what an arm moves is not known."""
    links = [tree.links[joint.child] for joint in carried]
    faults = [link.fault for link in links if link.fault]
    faults += negative_inertias(tree, [joint.child for joint in carried])
    bodies = [link.body for link in links if link.body is not None]
    if not faults and spec.tool is None and not any(body.mass > 0 for body in bodies):
        named = ", ".join(joint.child for joint in free)
        faults.append(f"{tree.file.name} has no inertials: none of {named} has a mass")
    return faults


def _body(tree: Tree, placed: Mapping[str, tuple[str | None, Pose]], joint: TreeJoint) -> Body:
    """Everything that a free joint carries and no joint behind it, in its frame."""
    bodies = [
        body.placed(pose)
        for link, (carrier, pose) in placed.items()
        if carrier == joint.name and (body := tree.links[link].body) is not None
    ]
    return reduce(Body.__add__, bodies) if bodies else _MASSLESS


def _locked(joint: TreeJoint, position: float) -> LockedJoint:
    limits = joint.lower, joint.upper
    if joint.kind == "continuous" or "limit" in joint.faults:
        limits = -np.inf, np.inf
    return LockedJoint(joint.name, position, *limits)


def _positive(
    joint: TreeJoint, what: str, i: int, given: Sequence[float] | None, doubts: Doubts
) -> float:
    """The limit of effort or velocity of a free joint, inf where it has none."""
    if given is not None:
        return given[i]
    return doubts.positive(what, joint.name, getattr(joint, what), joint.faults.get(what, ""))


def _limits(joint: TreeJoint, i: int, spec: RobotArm, doubts: Doubts) -> tuple[float, float, str]:
    """Lower and upper limit of a free joint, and why they cannot be used, if they cannot."""
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
    lower, upper = doubts.positions(joint.name, given)
    unlimited = joint.kind == "prismatic" and not np.isfinite([lower, upper]).all()
    fault = f"prismatic joint {joint.name!r} needs position_limits below 1e6" if unlimited else ""
    return lower, upper, fault


def _toml_key(name: str) -> str:
    return name if re.fullmatch(r"[\w-]+", name, re.ASCII) else json.dumps(name, ensure_ascii=False)
