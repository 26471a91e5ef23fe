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
from copose.report.placement import ANGLES, distance_rows, offset
from copose.report.slices import angular_slice, linear_slice
from copose.results import Posture, Solution


@dataclass(frozen=True)
class Comparison:
    """Two results of one cell, or of the same arms under two objectives.

    Attributes:
        names: what the two are called.
        solutions: the two.
        postures: the ``after`` of each; null where a result has cases.
    """

    names: tuple[str, str]
    solutions: tuple[Solution, Solution]
    postures: tuple[Posture | None, Posture | None]

    @property
    def cases(self) -> bool:
        """Whether one has cases, so that postures cannot be held against one another."""
        return None in self.postures

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
        if solution.after is None and not solution.cases:
            raise InputError("has no posture: null", key="after", file=name)
    for key, mine, theirs in (
        ("problem.space", one.problem.space, other.problem.space),
        ("joint_names", one.joint_names, other.joint_names),
    ):
        if mine != theirs:
            raise InputError(f"is not that of {names[0]}", key=key, file=names[1])
    return Comparison(names, (one, other), (one.after, other.after))


def comparison_table(comparison: Comparison) -> RenderableType:
    """Figures of both, and how far each joint is apart."""
    if comparison.cases:
        return Group(_totals(comparison), *_free(comparison), *_where(comparison))
    return Group(_figures(comparison), *_free(comparison), Text(""), _joints(comparison))


def _totals(comparison: Comparison) -> Table:
    """What was optimised, the totals, and each case's own value."""
    table = _settings(comparison, "its value (of cases: Σ weight · value)")
    found = [
        {case.name: case.objective for case in solution.cases or ()}
        for solution in comparison.solutions
    ]
    for name in found[0] | found[1]:
        cells = [style.six(each[name]) if name in each else "–" for each in found]
        table.add_row(Text(f"case {name}"), *cells)
    _add_distances(table, comparison)
    return table


def _free(comparison: Comparison) -> list[RenderableType]:
    """Where either has what was free; nothing where nothing was."""
    both = [
        {record.name: offset(record.after) for record in solution.freedom}
        for solution in comparison.solutions
    ]
    names = list(both[0] | both[1])
    if not names:
        return []
    table = plain_table("free: offset to its file's pose")
    for name in (*comparison.names, ""):
        table.add_column(Text(name), justify="right", overflow="fold")
    for name in names:
        unit = "rad" if name.rpartition(".")[2] in ANGLES else "m"
        table.add_row(Text(name), *(each.get(name, "–") for each in both), unit)
    return [Text(""), table]


def _where(comparison: Comparison) -> list[Text]:
    """Where postures are found."""
    both = zip(comparison.names, comparison.solutions, strict=True)
    return [
        Text(f"the postures of {name} are in its {len(solution.cases)} cases", style="dim")
        for name, solution in both
        if solution.cases
    ]


def _settings(comparison: Comparison, value: str) -> Table:
    """What was optimised, and its value."""
    table = plain_table("")
    for name in comparison.names:
        table.add_column(Text(name), justify="right", overflow="fold")
    both = comparison.solutions
    table.add_row("objective", *(solution.objective.kind for solution in both))
    values = [(solution.objective.after, solution.objective.unit) for solution in both]
    table.add_row(value, *(f"{style.six(number)} {unit}" for number, unit in values))
    table.add_row("axes", *(" ".join(solution.problem.axes) for solution in both))
    table.add_row("resolution", *(solution.problem.resolution for solution in both))
    table.add_row("torque scaling", *(solution.problem.torque_scaling for solution in both))
    return table


def _figures(comparison: Comparison) -> Table:
    table = _settings(comparison, "its value")
    postures = [posture for posture in comparison.postures if posture is not None]
    both = list(zip(comparison.solutions, postures, strict=True))
    for name in postures[0].log_volumes:
        volumes = [posture.log_volumes.get(name) for posture in postures]
        table.add_row(f"log-volume, {name}", *map(style.six, volumes))
    for k, (title, part) in enumerate((("linear", linear_slice), ("angular", angular_slice))):
        parts = [part(posture.ellipsoid, s.problem.axes) for s, posture in both]
        units = [style.units(solution)[k] for solution, _ in both]
        if any(parts):
            cells = [
                "–" if p is None else f"{style.numbers(tuple(p.ellipsoid.radii))} {unit}"
                for p, unit in zip(parts, units, strict=True)
            ]
            table.add_row(f"{title} semi-axes", *cells)
    centers = [posture.ellipsoid.center or () for posture in postures]
    if any(any(center) for center in centers):
        table.add_row("centre, at zero torque", *map(style.numbers, centers))
    limits = [limit_values(solution, posture) for solution, posture in both]
    for name in limits[0] | limits[1]:
        cells = [
            f"{style.three(each[name][0])} {each[name][1]}" if name in each else "–"
            for each in limits
        ]
        table.add_row(name, *cells)
    _add_distances(table, comparison)
    return table


def _add_distances(table: Table, comparison: Comparison) -> None:
    """The smallest distance of each, where one is known."""
    found = []
    for solution in comparison.solutions:
        alone = [] if solution.after is None else [solution.after]
        row = next(distance_rows([], solution.cases or alone), None)
        found.append("–" if row is None else f"{row[2]} m")
    if set(found) != {"–"}:
        table.add_row("smallest distance", *found)


def _joints(comparison: Comparison) -> Table:
    table = Table(show_edge=False, pad_edge=False)
    table.add_column("joint, rad or m", overflow="fold")
    for name in (*comparison.names, "difference"):
        table.add_column(Text(name), justify="right", overflow="fold")
    one, other = comparison.postures
    assert one is not None and other is not None
    for arm, names in comparison.solutions[0].joint_names.items():
        unlimited = comparison.solutions[0].unlimited.get(arm, ())
        for name, a, b in zip(names, one.joints[arm], other.joints[arm], strict=True):
            apart = math.remainder(b - a, math.tau) if name in unlimited else b - a
            table.add_row(Text(f"{arm}/{name}"), f"{a:.4f}", f"{b:.4f}", f"{apart:+.4f}")
    return table
