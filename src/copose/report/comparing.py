"""Two results of the same arms side by side."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from copose.errors import InputError
from copose.report import style
from copose.report.columns import plain_table
from copose.report.limits import limit_values
from copose.report.slices import angular_slice, linear_slice
from copose.results import Posture, Solution


@dataclass(frozen=True)
class Comparison:
    """Two results of one cell, or of the same arms under two objectives.

    Attributes:
        names: what the two are called.
        solutions: the two.
        postures: the ``after`` of each.
    """

    names: tuple[str, str]
    solutions: tuple[Solution, Solution]
    postures: tuple[Posture, Posture]

    @property
    def same_unit(self) -> bool:
        """Whether the semi-axes of both can be held against one another."""
        one, other = (style.units(solution) for solution in self.solutions)
        return one == other


def compare(one: Solution, other: Solution, names: tuple[str, str] = ("A", "B")) -> Comparison:
    """Two results side by side.

    Raises:
        InputError: a result has no posture, or the two are not of the same arms and space.
    """
    for solution, name in ((one, names[0]), (other, names[1])):
        if solution.after is None:
            raise InputError("has no posture: null", key="after", file=name)
    for key, mine, theirs in (
        ("problem.space", one.problem.space, other.problem.space),
        ("joint_names", one.joint_names, other.joint_names),
    ):
        if mine != theirs:
            raise InputError(f"is not that of {names[0]}", key=key, file=names[1])
    assert one.after is not None and other.after is not None
    return Comparison(names, (one, other), (one.after, other.after))


def comparison_table(comparison: Comparison) -> RenderableType:
    """Figures of both, and how far each joint is apart."""
    return Group(_figures(comparison), Text(""), _joints(comparison))


def _figures(comparison: Comparison) -> Table:
    table = plain_table("")
    for name in comparison.names:
        table.add_column(Text(name), justify="right", overflow="fold")
    both = list(zip(comparison.solutions, comparison.postures, strict=True))
    table.add_row("objective", *(solution.objective.kind for solution, _ in both))
    values = [(solution.objective.after, solution.objective.unit) for solution, _ in both]
    table.add_row("its value", *(f"{_number(value)} {unit}" for value, unit in values))
    table.add_row("axes", *(" ".join(solution.problem.axes) for solution, _ in both))
    table.add_row("resolution", *(solution.problem.resolution for solution, _ in both))
    table.add_row("torque scaling", *(solution.problem.torque_scaling for solution, _ in both))
    for name in comparison.postures[0].log_volumes:
        volumes = [posture.log_volumes.get(name) for posture in comparison.postures]
        table.add_row(f"log-volume, {name}", *map(_number, volumes))
    for k, (title, part) in enumerate((("linear", linear_slice), ("angular", angular_slice))):
        parts = [part(posture.ellipsoid, s.problem.axes) for s, posture in both]
        units = [style.units(solution)[k] for solution, _ in both]
        if any(parts):
            cells = [
                "–" if p is None else f"{style.numbers(tuple(p.ellipsoid.radii))} {unit}"
                for p, unit in zip(parts, units, strict=True)
            ]
            table.add_row(f"{title} semi-axes", *cells)
    centers = [posture.ellipsoid.center or () for posture in comparison.postures]
    if any(any(center) for center in centers):
        table.add_row("centre, at zero torque", *map(style.numbers, centers))
    limits = [limit_values(solution, posture) for solution, posture in both]
    for name in limits[0] | limits[1]:
        cells = [
            f"{style.three(each[name][0])} {each[name][1]}" if name in each else "–"
            for each in limits
        ]
        table.add_row(name, *cells)
    return table


def _joints(comparison: Comparison) -> Table:
    table = Table(show_edge=False, pad_edge=False)
    table.add_column("joint, rad or m", overflow="fold")
    for name in (*comparison.names, "difference"):
        table.add_column(Text(name), justify="right", overflow="fold")
    one, other = comparison.postures
    for arm, names in comparison.solutions[0].joint_names.items():
        unlimited = comparison.solutions[0].unlimited.get(arm, ())
        for name, a, b in zip(names, one.joints[arm], other.joints[arm], strict=True):
            apart = math.remainder(b - a, math.tau) if name in unlimited else b - a
            table.add_row(Text(f"{arm}/{name}"), f"{a:.4f}", f"{b:.4f}", f"{apart:+.4f}")
    return table


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.6f}"
