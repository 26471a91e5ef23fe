"""The panel of a study: legend, slider from the best to the worst, and the point that is shown."""

from __future__ import annotations

from typing import Protocol

import viser

from copose.live.panels.controls import Controls, put, put_content, see
from copose.live.panels.markup import block
from copose.live.plots.color_scale import ColorScale
from copose.live.plots.ranking_figure import ranking_svg
from copose.live.studies.point_words import counts, point_summary, ranking_words
from copose.live.studies.study_points import PARTS, StudyPoints

STEPS = ("Best", "Previous", "Next")
"""Words of the buttons that go through the ranking."""


class StudyActs(Protocol):
    """Actions of this panel; each returns at once."""

    def go(self, point: int) -> None:
        """Show a point."""

    def rank_by(self, value: str) -> None:
        """Rank and colour the points by another number."""

    def stand(self, body: str) -> None:
        """Let the points stand where another body does."""

    def see(self, part: str) -> None:
        """Show a part of the points in the scene, see `PARTS`."""


class StudyPanel:
    """The controls of a study, in a panel of their own."""

    def __init__(self, gui: viser.GuiApi, points: StudyPoints, acts: StudyActs) -> None:
        """Build the controls.

        Args:
            gui: the panels of viser.
            points: of the study.
            acts: the actions.
        """
        self._controls, self._acts = Controls(gui), acts
        self._points, self._point = points, 0
        self._here: list[int] = []
        self._window = gui.add_panel()
        with self._window.add_tab(points.table.study.file.name, viser.Icon.CHART_DOTS_3):
            gui.add_html(counts(points))
            self._add_choices(gui)
            self._curve = gui.add_html("")
            self._add_steps(gui)
            self._about = gui.add_html("")
            with gui.add_folder("Ranking", expand_by_default=not points.bodies.names):
                self._ranking = gui.add_html("")
        self._window.dock_left()

    def show(
        self, points: StudyPoints, point: int, here: list[int], objective: str, scale: ColorScale
    ) -> None:
        """Show a point, and the ranking.

        Args:
            points: of the study.
            point: number of the one that is shown.
            here: numbers of all that stand where it does, the best first.
            objective: its name with its unit.
            scale: colours of the number that ranks.
        """
        self._points, self._point, self._here = points, point, here
        rank, line = points.rank(point), points.table.line(point)
        title = objective if points.value == "objective" else points.value
        with self._controls.setting():
            if len(points.ranking):
                values = points.values[points.ranking]
                put_content(self._curve, block(ranking_svg(values, scale, title, rank)))
            if rank is not None:
                put(self._rank, rank + 1)
            put(self._number, point)
            see(self._place, len(here) > 1)
            if len(here) > 1:
                self._place.max = len(here)
                put(self._place, here.index(point) + 1)
            put_content(self._about, "" if line is None else point_summary(points, line, objective))
            put_content(self._ranking, ranking_words(points, point))

    def _add_choices(self, gui: viser.GuiApi) -> None:
        """Add what ranks the points, and which body they stand for, where there is a choice."""
        numbers, bodies = tuple(self._points.table.numbers), self._points.bodies.names
        if len(numbers) > 1:
            value = gui.add_dropdown(
                "value", numbers, initial_value=self._points.value, hint="colours and ranks points"
            )
            self._controls.when(value, lambda: self._acts.rank_by(value.value))
        if len(bodies) > 1:
            body = gui.add_dropdown("points at", bodies, hint="where each body is at the points")
            self._controls.when(body, lambda: self._acts.stand(body.value))
        if bodies:
            part = gui.add_dropdown("in the scene", PARTS, hint="points that the scene shows")
            self._controls.when(part, lambda: self._acts.see(part.value))

    def _add_steps(self, gui: viser.GuiApi) -> None:
        """Add what goes from point to point."""
        count = len(self._points.ranking)
        self._rank = gui.add_slider(
            "best → worst", 1, max(count, 2), 1, 1, visible=count > 1,
            hint="solved points in the order of their value",
        )  # fmt: skip
        self._controls.when(self._rank, lambda: self._go_to_rank(int(self._rank.value) - 1))
        steps = gui.add_button_group("", STEPS, visible=count > 0)
        self._controls.clicked(steps, lambda: self._step(steps.value))
        self._place = gui.add_slider(
            "at this place", 1, 2, 1, 1, visible=False, hint="points that stand at one place"
        )
        self._controls.when(self._place, self._go_here)
        self._number = gui.add_number(
            "point", 0, min=0, max=len(self._points.table) - 1, step=1, hint="by its number"
        )
        self._controls.when(self._number, lambda: self._acts.go(int(self._number.value)))

    def _step(self, word: str) -> None:
        """Go to the best point, or to the one before or after in the ranking."""
        rank = self._points.rank(self._point)
        if word == "Best" or rank is None:
            self._go_to_rank(0)
        else:
            self._go_to_rank(rank + (1 if word == "Next" else -1))

    def _go_to_rank(self, rank: int) -> None:
        if 0 <= rank < len(self._points.ranking):
            self._acts.go(int(self._points.ranking[rank]))

    def _go_here(self) -> None:
        """Show another point of the same place."""
        k = int(self._place.value) - 1
        if 0 <= k < len(self._here):
            self._acts.go(self._here[k])
