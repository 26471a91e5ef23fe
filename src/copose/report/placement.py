"""What a result says of where things were put, and of each case, as tables."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from copose.problem import SPACES
from copose.report import style
from copose.report.columns import compared_table, plain_table
from copose.report.limits import limit_values
from copose.report.titles import pair_words
from copose.results import CasePosture, FreeRecord, Posture, SearchRecord, Solution

ANGLES = ("roll", "pitch", "yaw", "angle", "twist")
# An offset nearer to an end of its range, as a share of the range, is at that end.
_END = 1e-4
# Cases whose joints are listed.
_CASES = 6


def free_tables(solution: Solution) -> list[Table]:
    """A row for each free coordinate: its range, and the offsets to the file's that were found."""
    if all(record.after is None for record in solution.freedom):
        return []
    compared = style.compared(solution)
    table = plain_table("free: offset to the file's pose")
    for title in ("range", *(("before",) * compared), style.now(solution)):
        table.add_column(title, justify="right")
    table.add_column("")
    for record in solution.freedom:
        cells = [offset(record.before)] * compared + [offset(record.after)]
        span = f"{record.lower:g} … {record.upper:g}"
        table.add_row(Text(record.name), span, *cells, _meaning(record))
    return [table]


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


def distance_rows(
    before: Sequence[Posture], after: Sequence[Posture]
) -> Iterator[tuple[str, str, str, str]]:
    """Name, before, after and words of the smallest distance; nothing where none is known."""
    was, now = (_nearest(postures) for postures in (before, after))
    if now is None or now.collision is None:
        return
    past = was.collision.distance if was is not None and was.collision is not None else None
    words = f"m, {pair_words(now, 40)}"
    if isinstance(now, CasePosture):
        words += f", case {now.name}"
    yield "smallest distance", style.three(past), style.three(now.collision.distance), words


def _nearest(postures: Sequence[Posture]) -> Posture | None:
    known = [(p.collision.distance, k) for k, p in enumerate(postures) if p.collision is not None]
    return postures[min(known)[1]] if known else None


def placement_lines(search: SearchRecord) -> list[str]:
    """What was tried of the free coordinates, where something was."""
    found = search.placements
    if found is None or not found.tried:
        return []
    tried = f"{found.tried:,} placement{'s' * (found.tried != 1)} tried"
    return [f"{tried}, {found.closed:,} of them closed, {found.polished:,} polished"]


def case_tables(solution: Solution) -> list[RenderableType]:
    """Every case's weight and objective with the total, what limits allow in it, and its joints."""
    cases, past = solution.cases or (), solution.cases_before or ()
    return [_objectives(solution, cases, past), _figures(solution, cases, past), *_joints(solution)]


def _objectives(
    solution: Solution, cases: Sequence[CasePosture], past: Sequence[CasePosture]
) -> Table:
    table = plain_table("case")
    for title in ("weight", *(("before",) * bool(past)), style.now(solution)):
        table.add_column(title, justify="right")
    table.add_column("")
    unit, earlier = style.objective_unit(solution), {case.name: case.objective for case in past}
    name = style.objective_name(solution)
    for case in cases:
        was = earlier.get(case.name)
        cells = [style.six(was)] * bool(past) + [style.six(case.objective)]
        gained = style.gain_between(solution, was, case.objective)
        words = ", ".join(filter(None, (f"{name} {unit}".rstrip(), gained)))
        table.add_row(Text(case.name), f"{case.weight:g}", *cells, words)
    objective = solution.objective
    totals = [style.six(objective.before)] * bool(past) + [style.six(objective.after)]
    gained = style.gain(solution)
    words = "Σ weight · objective" + (f", {gained} on average" if gained else "")
    table.add_row("total", "", *totals, words, style="bold")
    return table


def _figures(
    solution: Solution, cases: Sequence[CasePosture], past: Sequence[CasePosture]
) -> Table:
    table = compared_table(solution, "")

    def row(name: str, before: str, now: str, words: str) -> None:
        table.add_row(Text(name), *([before] * bool(past)), now, Text(words))

    earlier = {case.name: case for case in past}
    for case in cases:
        mine = limit_values(solution, case)
        old = limit_values(solution, earlier[case.name]) if case.name in earlier else {}
        for name, (value, unit) in mine.items():
            was = style.three(old.get(name, (None,))[0])
            row(f"{case.name}: {name}", was, style.three(value), unit)
    errors = [
        f"{max(error for case in some for error in case.closure_error.values()):.1e}"
        for some in (past, cases)
        if some
    ]
    unit = "m, rad" if SPACES[solution.problem.space].rigid else "m"
    row("closure error", errors[0], errors[-1], f"{unit}, the largest of all cases")
    for found in distance_rows(past, cases):
        row(*found)
    return table


def _joints(solution: Solution) -> list[RenderableType]:
    cases = solution.cases or ()
    title = "joints after, rad or m" if style.now(solution) == "after" else "joints, rad or m"
    table = plain_table("case", "arm", title)
    for case in cases[:_CASES]:
        for arm, positions in case.joints.items():
            words = " ".join(f"{position:.4f}" for position in positions)
            table.add_row(Text(case.name), Text(arm), words)
    if len(cases) <= _CASES:
        return [table]
    more = f"joints of {len(cases) - _CASES} more cases: in result.json"
    return [table, Text(more, style="dim")]
