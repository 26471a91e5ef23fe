"""Arms at their starts, before anything is solved, as tables on a terminal."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from rich.console import Group, RenderableType
from rich.text import Text

from copose.poses import Array
from copose.problem import Problem
from copose.report.text.columns import (
    aligned,
    counted,
    heading,
    joint_table,
    lines,
    note_lines,
    sections,
    table,
)
from copose.robots import ArmStart, Joint


def chains(
    problem: Problem, starts: tuple[ArmStart, ...], notes: tuple[str, ...], way: str | None
) -> RenderableType:
    """The chains as they were read, with their joints, limits and locks, where they start, and the
    path of the object in words; remarks below all else.
    """
    parts: list[RenderableType] = [heading(problem.name, problem.task.space)]
    arms = [start.arm for start in starts]
    for arm in arms:
        parts.append(Text(f"{arm.name}: {arm.model}, {counted(arm.n, 'joint')}"))
        if arm.locked:
            held = ", ".join(f"{joint.name} = {joint.position:g}" for joint in arm.locked)
            parts.append(Text(f"{arm.name}: locked: {held}"))
        if arm.fixed:
            parts.append(Text(f"{arm.name}: fixed: held at its start"))
    shown: dict[str, Callable[[Joint], str]] = {
        "kind": lambda joint: joint.kind,
        "lower": lambda joint: _limit(joint.lower, ".4f"),
        "upper": lambda joint: _limit(joint.upper, ".4f"),
        "effort": lambda joint: _limit(joint.effort, "g"),
        "speed": lambda joint: _limit(joint.velocity, "g"),
        "armature": lambda joint: f"{joint.armature:g}",
    }
    columns = {
        title: {arm.name: list(map(show, arm.joints)) for arm in arms}
        for title, show in shown.items()
    }
    parts.append(joint_table({arm.name: arm.joint_names for arm in arms}, columns))
    parts += start_table(problem, starts)
    if way is not None:
        parts.append(Text(way))
    parts += note_lines(notes)
    return sections(parts)


def guesses(made: Sequence[str]) -> RenderableType:
    """Lines on what a problem file was made with that nobody gave."""
    return Group(Text("guessed:"), *lines((" ", guess) for guess in made))


def start_table(problem: Problem, starts: Sequence[ArmStart]) -> list[RenderableType]:
    """A table of the frames of object, tips and grasps, and lines on what each arm misses."""
    planar = problem.space.planar
    frames = [("object", "world", problem.object.pose)]
    for start in starts:
        frames.append((f"{start.arm.name}: tip", "world", start.tip))
        frames.append(("", "object", start.tip_in_object))
        frames.append((f"{start.arm.name}: grasp", "object", start.arm.grasp))
    places = [
        (pose.position[:2], pose.rpy[2:]) if planar else (pose.position, pose.plain_rpy)
        for _, _, pose in frames
    ]
    columns = [aligned(list(map(_numbers, part)), "  ") for part in zip(*places, strict=True)]
    titles = "at the start", "in", "position, m", "angle, rad" if planar else "rpy, rad"
    rows = [(what, within, *cells)
            for (what, within, _), *cells in zip(frames, *columns, strict=True)]  # fmt: skip
    return [table(titles, rows), *(Text(start_words(start)) for start in starts)]


def start_words(start: ArmStart) -> str:
    """A sentence on whether an arm holds the object at its start, or by how much it misses."""
    name = f"arm {start.arm.name!r}"
    if start.given:
        if start.closed:
            return f"{name} holds the object at its start"
        moved = "" if start.arm.fixed else "; solve projects it onto the grasp where it can"
        return f"{name} misses its grasp by {start.miss} at its start{moved}"
    if start.closed:
        return f"{name} has no start; a random posture holds the object"
    both = ", in position and turn together," if start.rigid else ""
    return f"{name} has no start; of many random postures the nearest{both} misses by {start.miss}"


def _numbers(values: Sequence[float] | Array) -> list[str]:
    return [f"{round(float(value), 4) + 0.0:.4f}" for value in values]


def _limit(value: float, digits: str) -> str:
    return "none" if math.isinf(value) else format(value, digits)
