"""Two results of the same arms held against one another."""

from __future__ import annotations

from dataclasses import dataclass

from copose.errors import InputError
from copose.report.words import semi_axis_units
from copose.results import Posture, Solution


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
