"""Which postures of cases a picture shows."""

from __future__ import annotations

from dataclasses import dataclass

from copose.report import style
from copose.report.style import Panel
from copose.results import CasePosture, Posture, Solution


@dataclass(frozen=True)
class Row:
    """Postures of one time, or of one result.

    Attributes:
        name: what they are called.
        panels: one for each case.
        note: what is to be said of them.
    """

    name: str
    panels: list[Panel]
    note: str = ""


def case_rows(solution: Solution) -> list[Row]:
    """The postures of a result's cases, before and after; none where it has no cases."""
    rows = [
        Row(name, _panels(solution, cases))
        for name, cases in (("before", solution.cases_before), ("after", solution.cases))
        if cases
    ]
    if len(rows) == 1 and rows[0].name == "after":
        name = style.now(solution)
        return [Row(name, rows[0].panels, style.NOWHERE if name == "after" else "")]
    return rows


def result_row(name: str, solution: Solution) -> Row:
    """The answer of a result with or without cases."""
    if solution.cases is not None:
        return Row(name, _panels(solution, solution.cases))
    assert solution.after is not None
    return Row(name, [Panel(style.now(solution), solution.after, solution)])


def _panels(solution: Solution, cases: tuple[CasePosture, ...]) -> list[Panel]:
    panels = []
    for case in cases:
        weight = f", weight {case.weight:g}" if case.weight != 1 else ""
        panels.append(Panel(f"{style.short(case.name, 24)}{weight}", case, solution))
    return panels


def case_of(posture: Posture) -> str:
    """The case whose posture it is; empty where there are no cases."""
    return posture.name if isinstance(posture, CasePosture) else ""
