"""The layout of a page: its bodies and controls, whatever their places and numbers."""

from __future__ import annotations

from typing import Any

from copose.problem import Problem


def same_layout(one: Problem, other: Problem) -> bool:
    """True where a page of one problem shows the other one as well."""
    return one is other or _layout(one) == _layout(other)


def _layout(problem: Problem) -> dict[str, Any]:
    """Shapes, robots, axes, numbers of waypoints, names of cases."""
    robot = ("name", "urdf", "mjcf", "xacro_args", "packages", "root", "tip", "locked", "links")
    return {
        "space": problem.space.name,
        "arms": [[getattr(arm, key, None) for key in robot] for arm in problem.arms],
        "shape": problem.object.shape,
        "obstacles": [(obstacle.name, obstacle.shape) for obstacle in problem.obstacles],
        "axes": problem.axes,
        "waypoints": 0 if problem.path is None else len(problem.path.waypoints),
        "cases": [case.name for case in problem.cases],
    }
