"""The problem on the page: the opened one with changes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeAlias

from copose.live.problem_file.tables import tables_of
from copose.loader import parse
from copose.poses import Pose
from copose.problem import Problem, held, overridden

Changes: TypeAlias = Mapping[str, Any]
"""Values by the dotted paths of ``--set``."""


@dataclass(frozen=True)
class Document:
    """A problem as it was opened.

    Attributes:
        whole: the problem as it was read.
        case: the case that is shown, of several; empty where the file has none.
        point: number of the study's point whose problem it is; None without a study.
    """

    whole: Problem
    case: str = ""
    point: int | None = None

    @classmethod
    def of(cls, problem: Problem) -> Document:
        """The document of a problem; of several cases the first is shown."""
        return cls(problem, next(iter(case_names(problem)), ""))

    def of_case(self, case: str) -> Document:
        """The same with another case shown."""
        return replace(self, case=case)

    def problem(self, changes: Changes) -> Problem:
        """The problem with changes, as it would be saved: of several cases the one that is shown,
        and with nothing free but joints.

        Raises:
            InputError: changes that no problem has.
        """
        return parse(overridden(self._tables, changes), self.whole.source)

    @cached_property
    def _tables(self) -> Mapping[str, Any]:
        """The tables of the case that is shown."""
        return tables_of(held(self.whole, self.case))


def case_names(problem: Problem) -> tuple[str, ...]:
    """The cases of a problem."""
    return tuple(case.name for case in problem.cases)


def place(pose: Pose, *, planar: bool) -> dict[str, Any]:
    """A pose as a problem file has it: position, m, and rpy or angle, rad."""
    if planar:
        return {"position": pose.position[:2].tolist(), "angle": float(pose.rpy[2])}
    return {"position": pose.position.tolist(), "rpy": pose.rpy.tolist()}


def key(*parts: str) -> str:
    """A dotted path of names, in quotes where they need them."""
    return ".".join(part if part.isidentifier() else json.dumps(part) for part in parts)
