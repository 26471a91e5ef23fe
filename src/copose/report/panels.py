"""Panels of a picture: the postures of a result that it shows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from copose.report.words import answer_word, semi_axis_units, short
from copose.results import CasePosture, Posture, ProblemRecord, Solution

NOWHERE = "no posture closes at the file's pose"


class Drawn(Protocol):
    """A result, or a problem that has none yet, whose scene is drawn."""

    @property
    def problem(self) -> ProblemRecord:
        """The object's shape, and the obstacles."""
        ...


@dataclass(frozen=True)
class Panel:
    """One posture of a picture."""

    name: str
    posture: Posture
    solution: Solution  # the result that it is of
    other: Panel | None = None  # a panel whose ellipsoid is drawn as an outline over this one's
    note: str = ""  # a remark on it
    misses: bool = False  # whether the arms miss their grasps in it


@dataclass(frozen=True)
class Row:
    """Postures of one time, or of one result."""

    name: str
    panels: list[Panel]  # one for each case
    note: str = ""  # a remark on them


def result_panels(solution: Solution) -> list[Panel]:
    """The postures of a result: before, after, nearest miss."""
    if solution.before is None and solution.after is not None:
        name = answer_word(solution)
        return [Panel(name, solution.after, solution, note=NOWHERE if name == "after" else "")]
    panels = [
        Panel(name, posture, solution)
        for name, posture in (("before", solution.before), ("after", solution.after))
        if posture is not None
    ]
    if solution.nearest_miss is not None:
        panels.append(Panel("nearest miss", solution.nearest_miss, solution, misses=True))
    return panels


def case_rows(solution: Solution) -> list[Row]:
    """The postures of a result's cases, before and after; none where it has no cases."""
    rows = [
        Row(name, _case_panels(solution, cases))
        for name, cases in (("before", solution.cases_before), ("after", solution.cases))
        if cases
    ]
    if len(rows) == 1 and rows[0].name == "after":
        name = answer_word(solution)
        return [Row(name, rows[0].panels, NOWHERE if name == "after" else "")]
    return rows


def result_row(name: str, solution: Solution) -> Row:
    """The answer of a result with or without cases."""
    if solution.cases is not None:
        return Row(name, _case_panels(solution, solution.cases))
    assert solution.after is not None
    return Row(name, [Panel(answer_word(solution), solution.after, solution)])


def _case_panels(solution: Solution, cases: tuple[CasePosture, ...]) -> list[Panel]:
    panels = []
    for case in cases:
        weight = f", weight {case.weight:g}" if case.weight != 1 else ""
        panels.append(Panel(f"{short(case.name, 24)}{weight}", case, solution))
    return panels


def case_of(posture: Posture) -> str:
    """The name of the case of a posture; empty where there are no cases."""
    return posture.name if isinstance(posture, CasePosture) else ""


def holds(posture: Posture, arm: str) -> bool:
    """True where an arm holds the object: its tip is at its grasp, to 1e-6 m or rad."""
    return posture.closure_error[arm] <= 1e-6


def shared_scales(panels: list[Panel], longest: list[float], length: float) -> list[float] | None:
    """Metres drawn per unit of acceleration, by panel: one scale for all that share a unit.

    Args:
        panels: the panels.
        longest: the longest semi-axis of each, 0 where there is none.
        length: length at which the longest of all is drawn, m.

    Returns:
        None where there is nothing to draw.
    """
    if not any(longest):
        return None
    per_panel = []
    for panel in panels:
        alike = [
            radius
            for radius, other in zip(longest, panels, strict=True)
            if semi_axis_units(other.solution) == semi_axis_units(panel.solution)
        ]
        per_panel.append(length / max(max(alike), 1e-300) if any(alike) else 1.0)
    return per_panel
