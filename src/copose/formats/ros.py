"""Messages of ROS and MoveIt as YAML."""

from __future__ import annotations

import textwrap

import numpy as np

from copose.formats.postures import ByArm, ExportedPosture, knots, listed, unique_names
from copose.poses import Array
from copose.results import Motion, stacked


def joint_state_yaml(exported: ExportedPosture) -> str:
    """A ``sensor_msgs/JointState`` of the joints that the arms move, at rest.

    Raises:
        InputError: two joints would have one name.
    """
    lines = [
        _header(),
        f"name: {_names(exported.solution.joint_names)}",
        f"position: {_numbers(exported.posture.q)}",
        "velocity: []",
        "effort: []",
    ]
    return "\n".join(lines) + "\n"


def joint_trajectory_yaml(motion: Motion) -> str:
    """A ``trajectory_msgs/JointTrajectory``; ``effort`` is empty where the torque is unknown.

    Raises:
        InputError: nothing moves, or two joints would have one name.
    """
    lines = [_header(), f"joint_names: {_names(motion.joint_names)}", "points:"]
    for time, knot in knots(motion):
        sec, nanosec = divmod(round(time * 1e9), 10**9)
        lines += [
            f"- positions: {_numbers(knot.q)}",
            f"  velocities: {_numbers(stacked(knot.velocity))}",
            f"  accelerations: {_numbers(stacked(knot.acceleration))}",
            f"  effort: {_numbers(stacked(knot.torque) if knot.torque else np.zeros(0))}",
            f"  time_from_start: {{sec: {sec}, nanosec: {nanosec}}}",
        ]
    return "\n".join(lines) + "\n"


def _header() -> str:
    return 'header: {stamp: {sec: 0, nanosec: 0}, frame_id: ""}'


def _names(names: ByArm) -> str:
    return f"[{', '.join(map(_quoted, listed(unique_names(names))))}]"


def _numbers(values: Array) -> str:
    return f"[{', '.join(map(_number, values.tolist()))}]"


def _number(value: float) -> str:
    # YAML 1.1, which ROS reads, takes 1e-05 for a word and 1.0e-05 for a number.
    digits, e, power = repr(value).partition("e")
    return digits + (".0" if e and "." not in digits else "") + e + power


def _quoted(word: str) -> str:
    plain = (c if c.isprintable() and c not in '"\\' else f"\\U{ord(c):08x}" for c in word)
    return f'"{"".join(plain)}"'


def robot_state_yaml(exported: ExportedPosture) -> str:
    """A ``moveit_msgs/RobotState`` that changes the arms' joints and leaves all others.

    Raises:
        InputError: two joints would have one name.
    """
    return f"joint_state:\n{textwrap.indent(joint_state_yaml(exported), '  ')}is_diff: true\n"


def robot_trajectory_yaml(motion: Motion) -> str:
    """A ``moveit_msgs/RobotTrajectory``.

    Raises:
        InputError: nothing moves, or two joints would have one name.
    """
    return f"joint_trajectory:\n{textwrap.indent(joint_trajectory_yaml(motion), '  ')}"
