"""From a problem file to a problem: grasps that a start teaches are written out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from copose.errors import InputError
from copose.poses import Pose
from copose.problem import Problem, aimed, check_depth, is_planar, overridden, read_tables
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
    data = taught(read_tables(file), file)
    try:
        data = aimed(overridden(data, set or {}), objective, direction)
    except InputError as error:
        raise InputError(error.message, key=error.key, file=file) from None
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
    """The same tables with the grasps that their arms have at ``start`` where they have none.

    Where every arm is taught, an object without a position is midway between the tips.

    Raises:
        InputError: the problem, or a robot of it, cannot be read.
    """
    check_depth(data, source)
    arms, thing = data.get("arms"), data.get("object")
    if not isinstance(arms, (list, tuple)) or not isinstance(thing, Mapping):
        return data
    if not all(isinstance(arm, Mapping) for arm in arms):
        return data
    pupils = [i for i, arm in enumerate(arms) if "start" in arm and "grasp" not in arm]
    if not pupils:
        return data
    planar = is_planar(data)
    d = 2 if planar else 3
    between = "position" not in thing
    if between and len(pupils) < len(arms):
        text = "missing; only where every arm's grasp is taught is it midway between the tips"
        raise InputError(text, key="object.position", file=source)
    # What is to be found stands at the origin until it is.
    here = {"position": [0.0] * d}
    held = [{**arm, "grasp": here} if i in pupils else arm for i, arm in enumerate(arms)]
    held_thing = {**thing, **here} if between else thing
    problem = parse_complete({**data, "arms": held, "object": held_thing}, source)
    tips: dict[int, Pose] = {}
    for i, arm in enumerate(load_arms(problem)):
        if i in pupils and arm.start is not None:
            tips[i] = arm.tip_at(arm.start)
    place = problem.object.pose
    if between:
        middle = np.mean([tip.position for tip in tips.values()], axis=0)
        place = Pose.make(middle, place.rotation, place.quaternion)
        held_thing = {**thing, "position": middle[:d].tolist()}
    for i, tip in tips.items():
        grasp = place.inverse() @ tip
        turn = {"angle": float(grasp.rpy[2])} if planar else {"rpy": grasp.rpy.tolist()}
        held[i] = {**arms[i], "grasp": {"position": grasp.position[:d].tolist(), **turn}}
    return {**data, "arms": held, "object": held_thing}
