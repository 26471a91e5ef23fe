"""The choice of a point: the session takes its problem and the joints that were recorded there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from copose.errors import InputError
from copose.live.problem_file.document import Document
from copose.live.session.session import Session
from copose.studies.table import StudyTable


@dataclass(frozen=True, eq=False)
class PointChoice:
    """A session that shows one point after the other of a study.

    Attributes:
        session: the session.
        table: of the study.
    """

    session: Session
    table: StudyTable

    @property
    def point(self) -> int | None:
        """The number of the point that was chosen last and not undone."""
        return self.session.document.point

    def take(self, point: int, case: str = "") -> None:
        """Show a point: its problem, and the arms where they were recorded; nothing is searched.

        Where it is not solved the arms stay.

        Args:
            point: its number.
            case: of several cases the one that is shown; default the one that is, or the first.

        Raises:
            InputError: there is no such point, its problem is wrong, or its robots are others now.
        """
        line, document = self._line(point), document_at(self.table, point)
        case = case or self.session.document.case
        if case in [each.name for each in document.whole.cases]:
            document = document.of_case(case)
        joints, placed = (_of_case(line[key], document.case) for key in ("joints", "placement"))
        if line["status"] == "solved" and joints is not None:
            self.session.take(document, joints, f"point {point}", placed)
        else:
            self.session.stay(document, _why(line))

    def open(self, point: int) -> None:
        """Show the point that a page opens with; where it has no joints, the best of a search.

        Raises:
            InputError: as of `take`.
        """
        line = self._line(point)
        if line["status"] == "solved" and line["joints"] is not None:
            self.take(point)
        else:
            self.session.open()

    def _line(self, point: int) -> Mapping[str, Any]:
        line = self.table.line(point) if 0 <= point < len(self.table) else None
        if line is None:
            raise InputError(f"there is no point {point}, or it is not done yet", key="point")
        return line


def document_at(table: StudyTable, point: int) -> Document:
    """The problem of a point, of several cases the first.

    Raises:
        InputError: it is wrong.
    """
    return replace(Document.of(table.study.problems.at(table.values(point))), point=point)


def _of_case(recorded: Mapping[str, Any] | None, case: str) -> Any:
    """The recorded part of a case, or of a problem without cases."""
    return recorded.get(case) if recorded is not None and case else recorded


def _why(line: Mapping[str, Any]) -> str:
    """A line on why a point has no joints; the study's panel has its reason."""
    words = {"infeasible": "infeasible", "failed": "not solved"}
    if line["status"] == "solved":
        return "of a motion no joints are recorded: Plan in the tab Path finds it again"
    return f"point {line['point']} is {words[line['status']]}; the arms stay where they were"
