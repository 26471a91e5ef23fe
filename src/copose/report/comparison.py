"""Two results of the same arms side by side."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from copose.errors import InputError
from copose.report import style
from copose.report.text.columns import joint_table, lines, sections, table
from copose.report.text.ellipsoids import ellipsoid_rows
from copose.report.text.limits import limit_lines, limit_values
from copose.report.text.placement import ANGLES, offset
from copose.results import Posture, Solution

# What the two are called in tables.
_AB = ("A", "B")


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
    named = [Text(f"{letter}: {name}") for letter, name in zip(_AB, comparison.names, strict=True)]
    parts: list[RenderableType] = [*named * (comparison.names != _AB), _settings(comparison)]
    one, other = comparison.postures
    for letter, solution, posture in zip(
        _AB, comparison.solutions, comparison.postures, strict=True
    ):
        named_postures: dict[str, Posture] = {
            f"{case.name}: ": case for case in solution.cases or ()
        }
        if posture is not None:
            named_postures = {"": posture}
        parts += lines(
            (f"{letter}: {name}{about}", words)
            for name, each in named_postures.items()
            for about, words in limit_lines(solution, each)
        )
    if one is not None and other is not None:
        parts.append(_joints(comparison, one, other))
    parts += _free(comparison)
    if one is not None and other is not None:
        parts.append(_figures(comparison, (one, other)))
    both = zip(_AB, comparison.solutions, strict=True)
    parts += [
        Text(f"the postures of {name} are in its {len(solution.cases)} cases", style="dim")
        for name, solution in both
        if solution.cases
    ]
    return sections(parts)


def _settings(comparison: Comparison) -> Table:
    """What was optimised, its value, and each case's own."""
    both = comparison.solutions
    value = "Σ weight · value" if comparison.cases else "its value"
    rows: list[tuple[str, ...]] = [
        ("objective", *(solution.objective.kind for solution in both)),
        (value, *(f"{style.six(s.objective.after)} {s.objective.unit}" for s in both)),
        ("axes", *(" ".join(solution.problem.axes) for solution in both)),
        ("resolution", *(solution.problem.resolution for solution in both)),
        ("torque scaling", *(solution.problem.torque_scaling for solution in both)),
    ]
    cases = [{case.name: case for case in solution.cases or ()} for solution in both]
    for name in cases[0] | cases[1]:
        cells = [style.six(each[name].objective) if name in each else "–" for each in cases]
        rows.append((f"case {name}", *cells))
    return table(("", *_AB), rows)


def _free(comparison: Comparison) -> list[Table]:
    """Where either has what was free; nothing where nothing was."""
    both = [
        {record.name: offset(record.after) for record in solution.freedom}
        for solution in comparison.solutions
    ]
    rows = [
        (
            name,
            *(each.get(name, "–") for each in both),
            "rad" if name.rpartition(".")[2] in ANGLES else "m",
        )
        for name in both[0] | both[1]
    ]
    return [table(("free, from its file's pose", *_AB, ""), rows)] if rows else []


def _figures(comparison: Comparison, postures: tuple[Posture, Posture]) -> Table:
    both = list(zip(comparison.solutions, postures, strict=True))
    rows = list(ellipsoid_rows(both))
    limits = [limit_values(solution, posture) for solution, posture in both]
    for name in limits[0] | limits[1]:
        cells = [
            f"{style.three(each[name][0])} {each[name][1]}" if name in each else "–"
            for each in limits
        ]
        rows.append((name, *cells))
    return table(("ellipsoid", *_AB), rows)


def _joints(comparison: Comparison, one: Posture, other: Posture) -> Table:
    first = comparison.solutions[0]
    apart: dict[str, list[str]] = {}
    for arm, names in first.joint_names.items():
        unlimited = first.unlimited.get(arm, ())
        steps = zip(names, one.joints[arm], other.joints[arm], strict=True)
        apart[arm] = [
            f"{math.remainder(b - a, math.tau) if name in unlimited else b - a:+.4f}"
            for name, a, b in steps
        ]
    columns = {
        letter: {arm: [f"{x:.4f}" for x in q] for arm, q in posture.joints.items()}
        for letter, posture in zip(_AB, (one, other), strict=True)
    }
    return joint_table(first.joint_names, columns | {"difference": apart})
