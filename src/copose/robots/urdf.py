"""Arms from URDF files, by way of Pinocchio."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from copose.errors import InputError, nearest, one_line, shown
from copose.poses import Array, Pose, frozen_array
from copose.problem import UrdfArm
from copose.robots.arm import (
    Arm,
    Body,
    Joint,
    LockedJoint,
    check_lengths,
    freed,
    start_within_limits,
)
from copose.robots.paths import resolve
from copose.robots.urdf_tree import (
    MOVABLE,
    Tree,
    TreeJoint,
    joint_frame,
    link_frame,
    read_tree,
)


@dataclass(frozen=True, eq=False)
class Robot:
    """A URDF, read: its tree of names and Pinocchio's model of all its joints."""

    file: Path
    tree: Tree
    model: Any


@dataclass(frozen=True, eq=False)
class RobotOnBase:
    """Which robot an arm is part of, to tell whether two arms move independently.

    Attributes:
        file: the URDF.
        origin: T_world_universe of the whole robot.
        moves: its free joints that the arm may move.
        held: where the locked joints that the tip hangs on are held.
    """

    file: Path
    origin: Pose
    moves: frozenset[str]
    held: dict[str, float]

    def same(self, other: RobotOnBase) -> bool:
        """Whether the two arms are parts of one robot: one URDF at one base."""
        return self.file == other.file and np.allclose(
            np.column_stack([self.origin.rotation, self.origin.position]),
            np.column_stack([other.origin.rotation, other.origin.position]),
            rtol=0,
            atol=1e-9,
        )

    def clash(self, other: RobotOnBase) -> str | None:
        """Why the two arms cannot be parts of one robot that move independently."""
        if not self.same(other):
            return None
        mine, others = self.moves | self.held.keys(), other.moves | other.held.keys()
        for joint in sorted((self.moves & others) | (other.moves & mine)):
            return f"both hang on joint {joint!r}; lock it in both, so that they are independent"
        for joint in sorted(self.held.keys() & other.held.keys()):
            if self.held[joint] != other.held[joint]:
                return f"hold joint {joint!r} at different positions; lock it at one"
        return None


def read_robot(spec: UrdfArm, folder: Path, key: str, read: dict[Path, Robot]) -> Robot:
    """The robot of a ``urdf = …`` entry, read once per file.

    Args:
        spec: the ``[[arms]]`` table.
        folder: the problem file's, where relative paths start.
        key: of the table, for messages.
        read: robots already read, by file; grows.

    Raises:
        InputError: the file is missing or cannot be used.
    """
    try:
        file = resolve(spec.urdf, folder).resolve()
        if file not in read:
            tree = read_tree(file)
            read[file] = Robot(file, tree, _full_model(tree))
        return read[file]
    except InputError as error:
        text = f"{error.file}: {error.message}" if error.file else error.message
        raise InputError(text, key=f"{key}.urdf") from None
    except (OSError, ValueError, RuntimeError) as error:
        # What pathlib makes of unknown users, zero bytes, endless names and circular links.
        text = f"{shown(spec.urdf)} is no usable path: {error}"
        raise InputError(text, key=f"{key}.urdf") from None


def urdf_arm(spec: UrdfArm, robot: Robot, key: str) -> tuple[Arm, RobotOnBase]:
    """The chain root → tip of a URDF with every other joint locked.

    Args:
        spec: the ``[[arms]]`` table.
        robot: what its ``urdf`` names.
        key: of the table, for messages.

    Raises:
        InputError: the chain cannot be used; the message names the joint or link.
    """
    tree = robot.tree
    root = tree.root if spec.root is None else spec.root
    try:
        chain = tree.chain(root, spec.tip)
    except InputError as error:
        raise InputError(error.message, key=f"{key}.{error.key}") from None
    _check_locked(spec, tree, key)
    free = [j for j in chain if j.kind != "fixed" and j.name not in spec.locked]
    _check_kinds(free, key)
    names = tuple(joint.name for joint in free)
    if not names:
        raise InputError(f"no free joint between {root!r} and {spec.tip!r}", key=key)
    check_lengths(spec, names, key)

    model = _reduced(robot.model, frozenset(names), spec.locked)
    T_universe_root = _frame(model, root)
    base = spec.base.pose
    joints = tuple(_joint(model, i, joint, spec, key) for i, joint in enumerate(free))
    first = joints[0]
    joints = (replace(first, placement=T_universe_root.inverse() @ first.placement), *joints[1:])
    tip = _frame(model, spec.tip)
    if spec.tool is not None:
        tool = Body(
            spec.tool.mass, frozen_array(spec.tool.com), frozen_array(spec.tool.inertia)
        ).placed(tip)
        last = joints[-1]
        body = last.body + tool if last.body.mass > 0 else tool
        joints = (*joints[:-1], replace(last, body=body))
    _check_inertials(joints, free, tree, key)
    arm = Arm(
        name=spec.name,
        model=robot.file.name,
        joints=joints,
        base=base,
        tip=tip,
        grasp=spec.grasp.pose,
        start=start_within_limits(spec, joints, key),
        locked=_locked(tree, robot.model, chain, set(names), spec.locked),
        geared=spec.armature is not None,
        free=freed(spec),
        fixed=spec.fixed,
    )
    whole = RobotOnBase(
        file=robot.file,
        origin=base @ T_universe_root.inverse(),
        moves=frozenset(names),
        held={
            j.name: spec.locked.get(j.name, 0.0)
            for j in tree.ancestors(spec.tip)
            if j.kind in MOVABLE and j.name not in names
        },
    )
    return arm, whole


def _full_model(tree: Tree) -> Any:
    import pinocchio

    model, refused = None, ""
    with _native_stderr() as lines:
        try:
            model = pinocchio.buildModelFromXML(tree.xml)
        except (ValueError, RuntimeError) as error:
            refused = str(error)
    # The reader leaves out what it cannot parse, an inertial say, and goes on: wrong numbers.
    said = [line for line in lines if line.strip() and (model is None or "Error" in line)]
    if model is None or said:
        why = (said[0] if said else refused).replace("link:", "").replace("joint:", "")
        raise InputError(f"{tree.file.name} cannot be read as URDF: {one_line(why.strip())}")
    return model


@contextlib.contextmanager
def _native_stderr() -> Iterator[list[str]]:
    """Collect what the C++ URDF reader writes to file descriptor 2 past Python's sys.stderr."""
    lines: list[str] = []
    with tempfile.TemporaryFile() as sink:
        kept = os.dup(2)
        os.dup2(sink.fileno(), 2)
        try:
            yield lines
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            sink.seek(0)
            lines += sink.read().decode(errors="replace").splitlines()


def _check_locked(spec: UrdfArm, tree: Tree, key: str) -> None:
    for name in spec.locked:
        if name not in tree.movable:
            raise InputError(
                f"{name!r} is no movable joint of {tree.file.name}{nearest(name, tree.movable)}",
                key=f"{key}.locked",
            )


def _check_kinds(free: list[TreeJoint], key: str) -> None:
    for joint in free:
        if joint.kind not in MOVABLE:
            raise InputError(
                f"joint {joint.name!r} on the chain is {joint.kind or 'untyped'}; revolute, "
                "continuous and prismatic joints can be used",
                key=key,
            )
        if joint.mimics is not None:
            raise InputError(
                f"joint {joint.name!r} on the chain mimics {joint.mimics!r}; choose another tip "
                "or lock it",
                key=key,
            )


def _reduced(full: Any, free: frozenset[str], locked: dict[str, float]) -> Any:
    """Pinocchio's model with everything but the free joints locked and lumped."""
    import pinocchio

    held = [i for i in range(1, full.njoints) if _joint_name(full, i) not in free]
    return pinocchio.buildReducedModel(full, held, posture(full, locked))


def posture(full: Any, locked: dict[str, float]) -> Array:
    """Pinocchio's position vector: locked joints at their values, every other joint at 0."""
    import pinocchio

    position: Array = pinocchio.neutral(full)
    for index in range(1, full.njoints):
        joint = full.joints[index]
        if joint.nv != 1:
            continue
        value = locked.get(_joint_name(full, index), 0.0)
        continuous = joint.nq == 2
        position[joint.idx_q : joint.idx_q + joint.nq] = (
            (np.cos(value), np.sin(value)) if continuous else value
        )
    return position


def _joint_name(full: Any, index: int) -> str:
    name: str = full.names[index]
    return name.removeprefix(joint_frame(""))


def _locked(
    tree: Tree, model: Any, chain: list[TreeJoint], free: set[str], given: dict[str, float]
) -> tuple[LockedJoint, ...]:
    """The locked joints that matter to an arm: on its chain, or on what its free joints carry."""
    held = []
    for name, tree_joint in tree.movable.items():
        carried = any(above.name in free for above in tree.ancestors(tree_joint.child))
        if name not in free and (carried or tree_joint in chain):
            joint = model.joints[model.getJointId(joint_frame(name))]
            limits = -np.inf, np.inf
            if tree_joint.kind != "continuous":
                limits = (
                    float(model.lowerPositionLimit[joint.idx_q]),
                    float(model.upperPositionLimit[joint.idx_q]),
                )
            held.append(LockedJoint(name, given.get(name, 0.0), *limits))
    return tuple(held)


def _frame(model: Any, link: str) -> Pose:
    import pinocchio

    return pose_of(
        model.frames[model.getFrameId(link_frame(link), pinocchio.FrameType.BODY)].placement
    )


def pose_of(placement: Any) -> Pose:
    """Pinocchio's SE3 as a pose."""
    import pinocchio

    x, y, z, w = pinocchio.Quaternion(placement.rotation).normalized().coeffs()
    return Pose.make(placement.translation, placement.rotation, [w, x, y, z])


def _joint(model: Any, index: int, tree_joint: TreeJoint, spec: UrdfArm, key: str) -> Joint:
    number = model.getJointId(joint_frame(tree_joint.name))
    joint, inertia = model.joints[number], model.inertias[number]
    lower, upper = _limits(model, joint, index, tree_joint, spec, key)
    effort = float(model.upperEffortLimit[joint.idx_v]) if tree_joint.has_effort else np.inf
    speed = float(model.upperVelocityLimit[joint.idx_v]) if tree_joint.has_velocity else np.inf
    axis, kind = _axis(joint)
    return Joint(
        name=tree_joint.name,
        kind=kind,
        axis=axis,
        placement=pose_of(model.jointPlacements[number]),
        body=Body(float(inertia.mass), frozen_array(inertia.lever), frozen_array(inertia.inertia)),
        lower=lower,
        upper=upper,
        velocity=spec.velocity_limits[index] if spec.velocity_limits else speed,
        acceleration=spec.acceleration_limits[index] if spec.acceleration_limits else np.inf,
        effort=spec.torque_limits[index] if spec.torque_limits else effort,
        armature=spec.armature[index] if spec.armature else 0.0,
    )


def _limits(
    model: Any, joint: Any, index: int, tree_joint: TreeJoint, spec: UrdfArm, key: str
) -> tuple[float, float]:
    if spec.position_limits:
        return spec.position_limits[index]
    if tree_joint.kind == "continuous":
        return -np.inf, np.inf
    lower = float(model.lowerPositionLimit[joint.idx_q])
    upper = float(model.upperPositionLimit[joint.idx_q])
    if not lower < upper:
        raise InputError(
            f"{tree_joint.name!r} has no range in the URDF ({lower:g} … {upper:g}); give "
            "position_limits, or lock it",
            key=key,
        )
    return lower, upper


def _axis(joint: Any) -> tuple[Array, Literal["revolute", "prismatic"]]:
    data = joint.createData()
    joint.calc(data, np.array([1.0, 0.0]) if joint.nq == 2 else np.zeros(1))
    subspace = np.asarray(data.S).reshape(6)
    if np.any(subspace[3:]):
        return frozen_array(subspace[3:]), "revolute"
    return frozen_array(subspace[:3]), "prismatic"


def _check_inertials(
    joints: tuple[Joint, ...], free: list[TreeJoint], tree: Tree, key: str
) -> None:
    if not any(joint.body.mass > 0 for joint in joints):
        links = [joint.child for joint in free]
        raise InputError(
            f"{tree.file.name} has no inertials: none of {', '.join(links)} has a mass", key=key
        )
