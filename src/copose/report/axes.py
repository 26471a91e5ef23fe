"""Task coordinates: the world axis that each is along or about, and the units along them."""

from __future__ import annotations

from collections.abc import Iterable

from copose.results import Motion, Solution

LINEAR_AXES = {"x": 0, "y": 1, "z": 2}
ANGULAR_AXES = {"roll": 0, "pitch": 1, "yaw": 2, "angle": 2}


def semi_axis_units(solution: Solution | Motion) -> tuple[str, str]:
    """Units of linear and of angular semi-axes: per unit torque, or at the torque limits."""
    per = "" if solution.problem.torque_scaling == "limits" else " per N·m"
    return f"m/s²{per}", f"rad/s²{per}"


def acceleration_unit(names: Iterable[str]) -> str:
    """The unit of accelerations along some coordinates."""
    kinds = {name in ANGULAR_AXES for name in names}
    return ", ".join(("m/s²", "rad/s²")[kind] for kind in sorted(kinds))
