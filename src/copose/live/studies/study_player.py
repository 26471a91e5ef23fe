"""The page's part for a study: its points in the scene and in their panel, and steps among them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import viser

from copose.errors import InputError
from copose.live.plots.svg import ColorScale
from copose.live.problem_file.document import Document
from copose.live.session.session import Session
from copose.live.studies.point_cloud import PointCloud
from copose.live.studies.study_panel import StudyPanel
from copose.live.studies.study_points import PARTS, Marks, StudyPoints
from copose.live.worker import Worker
from copose.poses import Array
from copose.report.words import titled_objective
from copose.studies.table import StudyTable


@dataclass(frozen=True, eq=False)
class PointChoice:
    """A session that shows one point after the other of a study."""

    session: Session
    table: StudyTable  # of the study

    @property
    def point(self) -> int | None:
        """The number of the point that was chosen last and not undone."""
        return self.session.document.point

    def take(self, point: int, case: str = "") -> None:
        """Show a point, of several cases one: its problem, and the arms where they were recorded;
        nothing is searched.

        Where it is not solved the arms stay.

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


class StudyPlayer:
    """The actions of the panel of a study.

    Attributes:
        choice: of the point that is shown.
        points: of the study, with the number that ranks them.
        shows: function that has a point shown; the page sets it.
    """

    shows: Callable[[int], object]

    def __init__(self, table: StudyTable) -> None:
        """Open a session with the best point; where none is solved with the first that is done.

        Args:
            table: of the study.

        Raises:
            InputError: no point is done yet, or the problem cannot be used.
        """
        study = table.study.file
        self.points = StudyPoints(table, study.map.value)
        done = self.points.best_first
        if not len(done):
            raise InputError("no point is done yet: run it without --view", file=study.source)
        self._body = next(iter(self.points.bodies.names), None)
        self._cloud: PointCloud | None = None
        self._size, self._part = 1.0, PARTS[0]
        session = Session(document_at(table, int(done[0])), lambda state: None)
        self.choice = PointChoice(session, table)
        self.choice.open(int(done[0]))

    @property
    def places(self) -> Array:
        """Positions of the points in the scene, m, (count, 3)."""
        return np.zeros((0, 3)) if self._marks is None else self._marks.places

    def build(self, server: viser.ViserServer, worker: Worker) -> None:
        """Build the panel, and listen to clicks in the scene of a server."""
        self._server, self._worker = server, worker
        self._panel = StudyPanel(server.gui, self.points, self)
        server.scene.on_click()(self._clicked)

    def draw(self, size: float) -> None:
        """Draw the points in a new scene of a size, m."""
        self._size, marks = size, self._marks
        if marks is not None:
            self._cloud = PointCloud(
                self._server.scene, marks, size, standing=self._body != "object"
            )
            self._cloud.show(self.points, self._scale, self._part)

    def render(self) -> None:
        """Show the point that is chosen."""
        point = self.choice.point
        if point is None:
            return
        here = [point] if self._marks is None else self._marks.here(point)
        if self._cloud is not None:
            self._cloud.choose(point)
        self._panel.show(self.points, point, here, self._objective, self._scale)

    # What the panel can have done, see `StudyActs`.

    def go(self, point: int) -> None:
        """Show a point."""
        self.shows(point)

    def rank_by(self, value: str) -> None:
        """Rank and colour the points by another number."""
        self._worker.do(lambda: self._redraw(value, self._body, self._part))

    def stand(self, body: str) -> None:
        """Let the points stand where another body does."""
        self._worker.do(lambda: self._redraw(self.points.value, body, self._part))

    def see(self, part: str) -> None:
        """Show a part of the points in the scene."""
        self._worker.do(lambda: self._redraw(self.points.value, self._body, part))

    def _clicked(self, event: viser.SceneClickEvent) -> None:
        """Show the point that a hand has clicked."""
        if self._cloud is None:
            return
        point = self._cloud.hit(np.array(event.ray_origin), np.array(event.ray_direction))
        if point is not None:
            self.shows(point)

    def _redraw(self, value: str, body: str | None, part: str) -> None:
        """Draw the points by another number, where another body stands, or another part of them."""
        self.points, self._body, self._part = self.points.by(value), body, part
        for name in ("_marks", "_scale"):
            vars(self).pop(name, None)
        with self._server.atomic():
            if self._cloud is not None:
                self._cloud.remove()
            self.draw(self._size)
            self.render()
        self._server.flush()

    @cached_property
    def _marks(self) -> Marks | None:
        """The points in the scene; None where the study moves nothing there."""
        return None if self._body is None else self.points.marks(self._body)

    @cached_property
    def _scale(self) -> ColorScale:
        """The colours of the number that ranks."""
        return ColorScale.of(self.points.values)

    @property
    def _objective(self) -> str:
        """The objective's name with its unit; without where points have several objectives."""
        if any(key.startswith("objective") for key in self.points.table.study.file.keys):
            return "objective"
        return titled_objective(self.choice.session.state.solution)
