"""Two results of the same arms side by side, as tables."""

from __future__ import annotations

import math

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from copose.report.panels import Comparison
from copose.report.text.columns import joint_table, lines, sections, table
from copose.report.text.ellipsoids import ellipsoid_rows
from copose.report.text.limits import limit_lines, limit_values
from copose.report.text.solution import is_angle, offset
from copose.report.words import six, three
from copose.results import Posture


def comparison_table(comparison: Comparison) -> RenderableType:
    """Both results in numbers, and the difference of every joint."""
    titles = [
        Text(f"{letter}: {name}") for letter, name in zip("AB", comparison.names, strict=True)
    ]
    parts: list[RenderableType] = [
        *titles * (comparison.names != ("A", "B")),
        _settings(comparison),
    ]
    one, other = comparison.postures
    for letter, solution, posture in zip(
        "AB", comparison.solutions, comparison.postures, strict=True
    ):
        postures: dict[str, Posture] = {f"{case.name}: ": case for case in solution.cases or ()}
        if posture is not None:
            postures = {"": posture}
        parts += lines(
            (f"{letter}: {name}{about}", words)
            for name, shown in postures.items()
            for about, words in limit_lines(solution, shown)
        )
    if one is not None and other is not None:
        parts.append(_joints(comparison, one, other))
    parts += _free(comparison)
    if one is not None and other is not None:
        parts.append(_figures(comparison, (one, other)))
    both = zip("AB", comparison.solutions, strict=True)
    parts += [
        Text(f"the postures of {name} are in its {len(solution.cases)} cases", style="dim")
        for name, solution in both
        if solution.cases
    ]
    return sections(parts)


def _settings(comparison: Comparison) -> Table:
    """Objectives, their values, those of each case, and settings of the ellipsoid."""
    both = comparison.solutions
    value = "Σ weight · value" if comparison.cases else "its value"
    rows: list[tuple[str, ...]] = [
        ("objective", *(solution.objective.kind for solution in both)),
        (value, *(f"{six(s.objective.after)} {s.objective.unit}" for s in both)),
        ("axes", *(" ".join(solution.problem.axes) for solution in both)),
        ("resolution", *(solution.problem.resolution for solution in both)),
        ("torque scaling", *(solution.problem.torque_scaling for solution in both)),
    ]
    cases = [{case.name: case for case in solution.cases or ()} for solution in both]
    for name in cases[0] | cases[1]:
        values = [six(by_name[name].objective) if name in by_name else "–" for by_name in cases]
        rows.append((f"case {name}", *values))
    return table(("", *"AB"), rows)


def _free(comparison: Comparison) -> list[Table]:
    """Offsets of free coordinates in both; nothing where neither has any."""
    both = [
        {record.name: offset(record.after) for record in solution.freedom}
        for solution in comparison.solutions
    ]
    rows = [
        (name, *(offsets.get(name, "–") for offsets in both), "rad" if is_angle(name) else "m")
        for name in both[0] | both[1]
    ]
    return [table(("free, from its file's pose", *"AB", ""), rows)] if rows else []


def _figures(comparison: Comparison, postures: tuple[Posture, Posture]) -> Table:
    """Ellipsoids of both, and the numbers that torque limits decide."""
    both = list(zip(comparison.solutions, postures, strict=True))
    rows = list(ellipsoid_rows(both))
    limits = [limit_values(solution, posture) for solution, posture in both]
    for name in limits[0] | limits[1]:
        cells = [
            f"{three(each[name][0])} {each[name][1]}" if name in each else "–" for each in limits
        ]
        rows.append((name, *cells))
    return table(("ellipsoid", *"AB"), rows)


def _joints(comparison: Comparison, one: Posture, other: Posture) -> Table:
    """Joint positions of both and their differences, without turns where a joint has no limits."""
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
        for letter, posture in zip("AB", (one, other), strict=True)
    }
    return joint_table(first.joint_names, columns | {"difference": apart})
