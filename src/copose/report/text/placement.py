"""What a result says of where things were put, and of each case, as tables."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from copose.report import style
from copose.report.text.columns import joint_table, lines, table
from copose.report.text.ellipsoids import closure_row
from copose.report.text.limits import limit_lines, limit_values
from copose.results import CasePosture, FreeRecord, Solution

ANGLES = ("roll", "pitch", "yaw", "angle", "twist")
# An offset nearer to an end of its range, as a share of the range, is at that end.
_END = 1e-4
# Cases whose joints are listed.
_CASES = 6
# Cases beside one another.
_COLUMNS = 3


def free_tables(solution: Solution) -> list[Table]:
    """A row for each free coordinate: its range, and the offsets to the file's that were found."""
    if all(record.after is None for record in solution.freedom):
        return []
    compared = style.compared(solution)
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
    return [table(("free, from the file's pose", "range", *style.stages(solution), ""), rows)]


def offset(value: float | None) -> str:
    """An offset with its sign, m or rad; a dash where there is none."""
    return "–" if value is None else f"{round(value, 4) + 0.0:+.4f}"


def _meaning(record: FreeRecord) -> str:
    """Unit, an angle in degrees too, and whether a wider range would have let it go on."""
    now = record.after
    if record.name.rpartition(".")[2] not in ANGLES:
        words = "m"
    else:
        words = "rad" if now is None else f"rad, {round(math.degrees(now), 1) + 0.0:+g}°"
    if now is not None:
        near = _END * (record.upper - record.lower)
        for word, end in (("lower", record.lower), ("upper", record.upper)):
            if abs(now - end) <= near:
                words += f", at its {word} end"
    return words


def case_tables(solution: Solution) -> Iterator[RenderableType]:
    """Every case's weight and objective with the total, what limits it, and its joints."""
    cases, past = solution.cases or (), solution.cases_before or ()
    yield _objectives(solution, cases, past)
    earlier = {case.name: case for case in past}
    yield from lines(
        (f"{case.name}: {about}", words)
        for case in cases
        for about, words in limit_lines(solution, case, earlier.get(case.name))
    )
    some = cases[:_CASES]
    for i in range(0, len(some), _COLUMNS):
        yield joint_table(solution.joint_names, {
            case.name: {arm: [f"{x:.4f}" for x in q] for arm, q in case.joints.items()}
            for case in some[i : i + _COLUMNS]
        })  # fmt: skip
    if len(cases) > _CASES:
        yield Text(f"joints of {len(cases) - _CASES} more cases: in result.json", style="dim")
    yield _figures(solution, cases, past)


def _objectives(
    solution: Solution, cases: Sequence[CasePosture], past: Sequence[CasePosture]
) -> Table:
    unit, earlier = style.objective_unit(solution), {case.name: case.objective for case in past}
    name = style.objective_name(solution)
    rows = []
    for case in cases:
        was = earlier.get(case.name)
        cells = [style.six(was)] * bool(past) + [style.six(case.objective)]
        gained = style.gain_between(solution, was, case.objective)
        words = ", ".join(filter(None, (f"{name} {unit}".rstrip(), gained)))
        rows.append((case.name, f"{case.weight:g}", *cells, words))
    objective = solution.objective
    totals = [style.six(objective.before)] * bool(past) + [style.six(objective.after)]
    gained = style.gain(solution)
    words = "Σ weight · objective" + (f", {gained} on average" if gained else "")
    rows.append(("total", "", *totals, words))
    return table(("case", "weight", *style.stages(solution), ""), rows)


def _figures(
    solution: Solution, cases: Sequence[CasePosture], past: Sequence[CasePosture]
) -> Table:
    earlier = {case.name: case for case in past}
    rows = []
    for case in cases:
        mine = limit_values(solution, case)
        old = limit_values(solution, earlier[case.name]) if case.name in earlier else {}
        for name, (value, unit) in mine.items():
            was = style.three(old.get(name, (None,))[0])
            cells = [was] * bool(past) + [style.three(value)]
            rows.append((f"{case.name}: {name}, {unit}", *cells))
    rows.append(closure_row(solution.problem.space, [some for some in (past, cases) if some]))
    return table(("in all cases", *style.stages(solution)), rows)
