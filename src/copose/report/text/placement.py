"""Free coordinates of a result, and its cases, as tables."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from copose.report.text.columns import joint_table, lines, table
from copose.report.text.ellipsoids import closure_row
from copose.report.text.limits import end_width, limit_lines, limit_values
from copose.report.words import (
    gain_between,
    has_before,
    objective_name,
    objective_unit,
    result_gain,
    six,
    stage_titles,
    three,
)
from copose.results import CasePosture, FreeRecord, Solution


def free_tables(solution: Solution) -> list[Table]:
    """A table of free coordinates: the range of each, and its offsets to the file's pose."""
    if all(record.after is None for record in solution.freedom):
        return []
    compared = has_before(solution)
    rows = [
        (
            record.name,
            f"{record.lower:g} … {record.upper:g}",
            *([offset(record.before)] * compared),
            offset(record.after),
            _meaning(record),
        )
        for record in solution.freedom
    ]
    return [table(("free, from the file's pose", "range", *stage_titles(solution), ""), rows)]


def offset(value: float | None) -> str:
    """An offset with its sign, m or rad; a dash where there is none."""
    return "–" if value is None else f"{round(value, 4) + 0.0:+.4f}"


def is_angle(name: str) -> bool:
    """True where a free coordinate, by its name, is an angle and no length."""
    return name.rpartition(".")[2] in ("roll", "pitch", "yaw", "angle", "twist")


def _meaning(record: FreeRecord) -> str:
    """Unit, an angle in degrees too, and whether a wider range would have let it go on."""
    now = record.after
    if not is_angle(record.name):
        words = "m"
    else:
        words = "rad" if now is None else f"rad, {round(math.degrees(now), 1) + 0.0:+g}°"
    if now is not None:
        near = end_width(record.lower, record.upper)
        for word, end in (("lower", record.lower), ("upper", record.upper)):
            if abs(now - end) <= near:
                words += f", at its {word} end"
    return words


def case_tables(solution: Solution, *, most: int = 6, a_row: int = 3) -> Iterator[RenderableType]:
    """Weight and objective of every case with the total, limits that it meets, and joints of the
    first cases, some beside one another.
    """
    cases, past = solution.cases or (), solution.cases_before or ()
    yield _objectives(solution, cases, past)
    earlier = {case.name: case for case in past}
    yield from lines(
        (f"{case.name}: {about}", words)
        for case in cases
        for about, words in limit_lines(solution, case, earlier.get(case.name))
    )
    listed = cases[:most]
    for i in range(0, len(listed), a_row):
        yield joint_table(solution.joint_names, {
            case.name: {arm: [f"{x:.4f}" for x in q] for arm, q in case.joints.items()}
            for case in listed[i : i + a_row]
        })  # fmt: skip
    if len(cases) > most:
        yield Text(f"joints of {len(cases) - most} more cases: in result.json", style="dim")
    yield _figures(solution, cases, past)


def _objectives(
    solution: Solution, cases: Sequence[CasePosture], past: Sequence[CasePosture]
) -> Table:
    """A table with a row for each case and the total."""
    unit, earlier = objective_unit(solution), {case.name: case.objective for case in past}
    name = objective_name(solution)
    rows = []
    for case in cases:
        was = earlier.get(case.name)
        cells = [six(was)] * bool(past) + [six(case.objective)]
        gained = gain_between(solution, was, case.objective)
        words = ", ".join(filter(None, (f"{name} {unit}".rstrip(), gained)))
        rows.append((case.name, f"{case.weight:g}", *cells, words))
    objective = solution.objective
    totals = [six(objective.before)] * bool(past) + [six(objective.after)]
    gained = result_gain(solution)
    words = "Σ weight · objective" + (f", {gained} on average" if gained else "")
    rows.append(("total", "", *totals, words))
    return table(("case", "weight", *stage_titles(solution), ""), rows)


def _figures(
    solution: Solution, cases: Sequence[CasePosture], past: Sequence[CasePosture]
) -> Table:
    """A table of the numbers that torque limits decide, and of the closure error, in all cases."""
    earlier = {case.name: case for case in past}
    rows = []
    for case in cases:
        values = limit_values(solution, case)
        old = limit_values(solution, earlier[case.name]) if case.name in earlier else {}
        for name, (value, unit) in values.items():
            was = three(old.get(name, (None,))[0])
            cells = [was] * bool(past) + [three(value)]
            rows.append((f"{case.name}: {name}, {unit}", *cells))
    rows.append(closure_row(solution.problem.space, [group for group in (past, cases) if group]))
    return table(("in all cases", *stage_titles(solution)), rows)
