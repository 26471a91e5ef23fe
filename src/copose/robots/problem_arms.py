"""The arms of a problem: those given by their links, and those that are parts of robots."""

from __future__ import annotations

import numpy as np

from copose.errors import InputError, arm_key, blamed_on
from copose.poses import Pose, frozen_array
from copose.problem import PlanarArm, Problem
from copose.robots.arm import Arm, Body, Joint, freed
from copose.robots.limits import LimitNotes, check_lengths, start_within_limits


def planar_arm(spec: PlanarArm, key: str) -> Arm:
    """The arm of a ``links`` table.

    Raises:
        InputError: an array of the wrong length, or a start outside its limits.
    """
    names = tuple(f"joint{i + 1}" for i in range(len(spec.links)))
    check_lengths(spec, names, key)
    tip = Pose.from_rpy((spec.links[-1].length, 0.0, 0.0))
    joints, notes = [], LimitNotes()
    reach = 0.0
    for i, link in enumerate(spec.links):
        body = _body(link.mass, (link.com, 0.0), link.inertia)
        if spec.tool is not None and i + 1 == len(spec.links):
            tool = _body(spec.tool.mass, spec.tool.com, spec.tool.inertia)
            body = body + tool.placed(tip)
        limits = spec.position_limits[i] if spec.position_limits else (-np.inf, np.inf)
        lower, upper = notes.positions(names[i], limits)
        joints.append(
            Joint(
                name=names[i],
                kind="revolute",
                axis=frozen_array([0.0, 0.0, 1.0]),
                placement=Pose.from_rpy((reach, 0.0, 0.0)),
                body=body,
                lower=lower,
                upper=upper,
                velocity=spec.velocity_limits[i] if spec.velocity_limits else np.inf,
                acceleration=spec.acceleration_limits[i] if spec.acceleration_limits else np.inf,
                effort=spec.torque_limits[i] if spec.torque_limits else np.inf,
                armature=spec.armature[i] if spec.armature else 0.0,
            )
        )
        reach = link.length
    chain = tuple(joints)
    return Arm(
        name=spec.name,
        model="planar links",
        joints=chain,
        base=spec.base.pose,
        tip=tip,
        grasp=spec.grasp.pose,
        start=start_within_limits(spec, chain, key),
        free=freed(spec),
        fixed=spec.fixed,
        notes=notes.told(spec.name),
    )


def _body(mass: float, com: tuple[float, float], inertia: float) -> Body:
    # Only the moment about z moves in the plane; the others keep the matrix positive definite.
    return Body(mass, frozen_array([*com, 0.0]), frozen_array(np.eye(3) * inertia))


def load_arms(problem: Problem) -> tuple[Arm, ...]:
    """Read every arm of a problem into plain numbers, in file order.

    Raises:
        InputError: a robot cannot be read, has fewer free joints than the task needs, a margin
            that eats a joint's range, or two arms that do not move independently.
    """
    with blamed_on(problem.source):
        planar = [spec for spec in problem.arms if isinstance(spec, PlanarArm)]
        if planar:
            arms = [planar_arm(spec, arm_key(i, spec.name)) for i, spec in enumerate(planar)]
        else:
            # Planar problems need not wait for the readers of robots' files.
            from copose.robots.whole_robot import robot_parts

            arms = [part.arm for part in robot_parts(problem)]
        for i, arm in enumerate(arms):
            _check(arm, problem, arm_key(i, arm.name))
    return tuple(arms)


def _check(arm: Arm, problem: Problem, key: str) -> None:
    """Refuse an arm with too few joints for the task, or a margin that leaves a joint no range."""
    space, margin = problem.space, problem.constraints.joint_margin
    if arm.n < space.m:
        raise InputError(
            f"has {arm.n} free joints ({', '.join(arm.joint_names)}); space "
            f"{space.name!r} needs at least {space.m}",
            key=key,
        )
    for joint in arm.joints:
        if joint.lower + margin >= joint.upper - margin:
            raise InputError(
                f"{margin:g} leaves nothing of the range of joint {joint.name!r} of arm "
                f"{arm.name!r} ({joint.lower:g} … {joint.upper:g})",
                key="constraints.joint_margin",
            )
