"""Messages of MoveIt as YAML: a posture is a RobotState, a motion a RobotTrajectory."""

from __future__ import annotations

import textwrap

from copose.formats.postures import ExportedPosture
from copose.formats.ros import joint_state_yaml, joint_trajectory_yaml
from copose.results import Motion


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
