"""The reader of problem files; grasps that a start teaches are written out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from copose.errors import InputError, blamed_on
from copose.poses import Pose
from copose.problem import Problem, aimed, check_depth, is_planar, is_study, overridden, read_tables
from copose.problem import parse as parse_complete
from copose.robots import load_arms


def load(
    path: str | Path,
    *,
    set: Mapping[str, Any] | None = None,  # noqa: A002
    objective: str | None = None,
    direction: Sequence[float] | None = None,
) -> Problem:
    """Read a problem file.

    Args:
        path: of the file.
        set: values in place of the file's, by dotted path: ``{"arms.left.base.position.y": 0.4}``.
            Grasps are taught before.
        objective: its kind in place of the file's.
        direction: of the objective, as in the file; three numbers in space are linear. Without a
            kind that of task compatibility.

    Raises:
        InputError: the file cannot be read, is not TOML, or breaks a rule of the format; the
            message names the first fault and how many more there are.
    """
    file = Path(path)
    data: Mapping[str, Any] = read_tables(file)
    if is_study(data):
        raise InputError("is a study file; `copose study` runs it", file=file)
    data = taught(data, file)
    with blamed_on(file):
        data = aimed(overridden(data, set or {}), objective, direction)
    return parse_complete(data, file)


def parse(data: Mapping[str, Any], source: Path | None = None) -> Problem:
    """A problem from the same tables as a dict.

    Args:
        data: what a TOML reader makes of a problem file.
        source: the file it came from; relative paths in it start there.

    Raises:
        InputError: as for `load`.
    """
    return parse_complete(taught(data, source), source)


def taught(data: Mapping[str, Any], source: Path | None = None) -> Mapping[str, Any]:
    """The tables of a problem with taught grasps: those that arms without one have at ``start``.

    Where every arm is taught, an object without a position is midway between the tips.

    Raises:
        InputError: the problem, or a robot of it, cannot be read.
    """
    check_depth(data, source)
    arms, held_object = data.get("arms"), data.get("object")
    if not isinstance(arms, (list, tuple)) or not isinstance(held_object, Mapping):
        return data
    if not all(isinstance(arm, Mapping) for arm in arms):
        return data
    taught_arms = [i for i, arm in enumerate(arms) if "start" in arm and "grasp" not in arm]
    if not taught_arms:
        return data
    planar = is_planar(data)
    d = 2 if planar else 3
    between = "position" not in held_object
    if between and len(taught_arms) < len(arms):
        text = "missing; only where every arm's grasp is taught is it midway between the tips"
        raise InputError(text, key="object.position", file=source)
    # Grasps and a position that are not known yet stand at the origin.
    origin = {"position": [0.0] * d}
    new_arms = [{**arm, "grasp": origin} if i in taught_arms else arm for i, arm in enumerate(arms)]
    new_object = {**held_object, **origin} if between else held_object
    problem = parse_complete({**data, "arms": new_arms, "object": new_object}, source)
    tips: dict[int, Pose] = {}
    for i, arm in enumerate(load_arms(problem)):
        if i in taught_arms and arm.start is not None:
            tips[i] = arm.tip_at(arm.start)
    object_pose = problem.object.pose
    if between:
        middle = np.mean([tip.position for tip in tips.values()], axis=0)
        object_pose = Pose.make(middle, object_pose.rotation, object_pose.quaternion)
        new_object = {**held_object, "position": middle[:d].tolist()}
    for i, tip in tips.items():
        grasp = object_pose.inverse() @ tip
        turn = {"angle": float(grasp.rpy[2])} if planar else {"rpy": grasp.rpy.tolist()}
        new_arms[i] = {**arms[i], "grasp": {"position": grasp.position[:d].tolist(), **turn}}
    return {**data, "arms": new_arms, "object": new_object}
