"""The joint positions of a motion as tables that other programs read."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from itertools import chain

from copose.errors import InputError
from copose.results.motion import Knot, Motion


def trajectory_csv(motion: Motion) -> str:
    """``time, arm/joint, …``: a row for every knot, s and rad or m, numbers in full.

    Raises:
        InputError: nothing moves.
    """
    sink = io.StringIO()
    writer = csv.writer(sink, lineterminator="\n")
    names = motion.joint_names.items()
    writer.writerow(["time", *(f"{arm}/{joint}" for arm, joints in names for joint in joints)])
    for time, knot in _knots(motion):
        writer.writerow(map(repr, [time, *_stacked(motion, knot.joints)]))
    return sink.getvalue()


def joint_trajectory_yaml(motion: Motion) -> str:
    """A ``trajectory_msgs/JointTrajectory``; ``effort`` is empty where the torque is unknown.

    Joints are called as in the URDF where all arms' differ, else ``arm_joint``.

    Raises:
        InputError: nothing moves.
    """
    names = list(chain.from_iterable(motion.joint_names.values()))
    if len(set(names)) < len(names):
        names = [f"{arm}_{joint}" for arm, mine in motion.joint_names.items() for joint in mine]
    lines = [
        'header: {stamp: {sec: 0, nanosec: 0}, frame_id: ""}',
        f"joint_names: [{', '.join(map(_quoted, names))}]",
        "points:",
    ]
    for time, knot in _knots(motion):
        sec, nanosec = divmod(round(time * 1e9), 10**9)
        lines += [
            f"- positions: {_listed(_stacked(motion, knot.joints))}",
            f"  velocities: {_listed(_stacked(motion, knot.velocity))}",
            f"  accelerations: {_listed(_stacked(motion, knot.acceleration))}",
            f"  effort: {_listed(_stacked(motion, knot.torque) if knot.torque else [])}",
            f"  time_from_start: {{sec: {sec}, nanosec: {nanosec}}}",
        ]
    return "\n".join(lines) + "\n"


def _knots(motion: Motion) -> Iterable[tuple[float, Knot]]:
    if motion.time is None or motion.knots is None:
        raise InputError(f"no motion to write: {motion.reason}")
    return zip(motion.time, motion.knots, strict=True)


def _stacked(motion: Motion, parts: dict[str, tuple[float, ...]]) -> list[float]:
    return [value for arm in motion.joint_names for value in parts[arm]]


def _listed(values: list[float]) -> str:
    return f"[{', '.join(map(_number, values))}]"


def _number(value: float) -> str:
    # YAML 1.1, which ROS reads, takes 1e-05 for a word and 1.0e-05 for a number.
    digits, e, power = repr(value).partition("e")
    return digits + (".0" if e and "." not in digits else "") + e + power


def _quoted(word: str) -> str:
    plain = (c if c.isprintable() and c not in '"\\' else f"\\U{ord(c):08x}" for c in word)
    return f'"{"".join(plain)}"'
