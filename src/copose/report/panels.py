"""Panels of a picture: the postures of a result, or of two that are compared, and their titles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from copose.errors import InputError
from copose.problem import SPACES
from copose.report.words import answer_word, semi_axis_units, short, three, value_words
from copose.results import CasePosture, Posture, ProblemRecord, Solution


@dataclass(frozen=True)
class Comparison:
    """Two results of one cell, or of the same arms under two objectives."""

    names: tuple[str, str]  # what the two are called
    solutions: tuple[Solution, Solution]
    # The ``after`` of each; null where a result has cases.
    postures: tuple[Posture | None, Posture | None]

    @property
    def cases(self) -> bool:
        """True where one has cases, so that postures cannot be held against one another."""
        return None in self.postures

    @property
    def same_unit(self) -> bool:
        """True where the semi-axes of both can be held against one another."""
        one, other = (semi_axis_units(solution) for solution in self.solutions)
        return one == other


def compare(one: Solution, other: Solution, names: tuple[str, str] = ("A", "B")) -> Comparison:
    """Two results side by side.

    Raises:
        InputError: a result has no posture, or the two are not of the same arms and space.
    """
    for solution, name in ((one, names[0]), (other, names[1])):
        if solution.after is None and not solution.cases:
            raise InputError("has no posture: null", key="after", file=name)
    for key, first, second in (
        ("problem.space", one.problem.space, other.problem.space),
        ("joint_names", one.joint_names, other.joint_names),
    ):
        if first != second:
            raise InputError(f"is not that of {names[0]}", key=key, file=names[1])
    return Comparison(names, (one, other), (one.after, other.after))


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

    The longest of the semi-axes, 0 of a panel without one, is drawn at a length, m; None where
    there is nothing to draw.
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


def title(panel: Panel) -> str:
    """A panel's name and value; in a line of its own each the nearest bodies and the note."""
    posture, solution = panel.posture, panel.solution
    if panel.misses:
        unit = "m or rad" if SPACES[solution.problem.space].rigid else "m"
        return f"{panel.name}: gap {max(posture.closure_error.values()):.3g} {unit}"
    lines = [f"{panel.name}: {value_words(solution, posture)}", distance_words(posture), panel.note]
    return "\n".join(filter(None, lines))


def distance_words(posture: Posture, most: int = 40) -> str:
    """The smallest distance and the two bodies that it is between; empty where it is not known."""
    if posture.collision is None:
        return ""
    pair = " – ".join(short(name, most) for name in posture.collision.pair)
    return f"nearest: {three(posture.collision.distance)} m, {pair}"


def moved_words(solution: Solution, *, most: int = 4, least: float = 0.01) -> str:
    """The joints that differ most between before and after, by at least so much, and by how much,
    rad or m; empty where there is none.
    """
    before, after = solution.before, solution.after
    if before is None or after is None:
        return ""
    moves = [
        (new - old, f"{short(arm)} {short(name, 30)}")
        for arm, names in solution.joint_names.items()
        for name, old, new in zip(names, before.joints[arm], after.joints[arm], strict=True)
    ]
    largest = sorted(moves, key=lambda move: -abs(move[0]))[:most]
    named = [f"{name} {move:+.2f}" for move, name in largest if abs(move) >= least]
    return f"moved most, rad or m: {', '.join(named)}" if named else ""
