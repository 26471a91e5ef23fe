"""The panel of a study: legend, slider from the best to the worst, and the point that is shown."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from html import escape
from typing import Any, Protocol

import viser

from copose.live.panels.controls import Controls, put, put_content, see
from copose.live.panels.readout import block
from copose.live.plots.ranking_figure import ranking_svg
from copose.live.plots.svg import ColorScale
from copose.live.studies.point_cloud import CLOUD
from copose.live.studies.study_points import PARTS, StudyPoints
from copose.report.look import LOOK
from copose.report.words import six, three


def counts(points: StudyPoints) -> str:
    """Numbers of points by status, with the marks that they have."""
    count, look = Counter[str](points.table.statuses), CLOUD
    parts = [f"<b>{len(points.table)} points</b>, {count['solved']} solved"]
    for status, mark, color in (("infeasible", "●", look.infeasible), ("failed", "◆", look.failed)):
        if count[status]:
            parts.append(f'<span style="color: {color}">{mark}</span> {count[status]} {status}')
    if count["missing"]:
        parts.append(f"{count['missing']} not done yet")
    hint = "Click a point: the arms go there." if points.bodies.names else ""
    return block(f'{", ".join(parts)}<div style="opacity: 0.7">{hint}</div>')


def point_summary(points: StudyPoints, line: Mapping[str, Any], title: str) -> str:
    """A point: number, rank, status, reason, objective, values and what was recorded."""
    rank = points.rank(line["point"])
    head = f"point {line['point']}"
    if rank is not None:
        head += f", number {rank + 1} of {len(points.ranking)}"
    solved = line["status"] == "solved"
    color = LOOK.arms[1] if solved else LOOK.over
    said = line["status"] + (f": {line['reason']}" if line["reason"] else "")
    rows = [(title, f"<b>{six(line['objective'])}</b>")] if solved else []
    rows += [(key, escape(_shown(value))) for key, value in line["values"].items()]
    rows += [(key, escape(_shown(value))) for key, value in line["record"].items()]
    if len(points.table.study.points.seeds) > 1:
        rows.append(("seed", str(line["seed"])))
    return block(
        f'<b id="study-point">{head}</b>'
        f'<div id="study-status" style="color: {color}">{escape(said)}</div>{_rows(rows)}'
    )


def ranking_words(points: StudyPoints, point: int | None, rows: int = 9) -> str:
    """The points around one in the ranking: rank, value, and the values of keys."""
    order, rank = points.ranking, 0 if point is None else points.rank(point) or 0
    begin = max(0, min(rank - rows // 2, len(order) - rows))
    lines = []
    for k, other in enumerate(order[begin : begin + rows].tolist(), begin):
        values = ", ".join(_shown(value) for value in points.table.values(other).values())
        here = "font-weight: bold" if other == point else ""
        cells = (str(k + 1), three(float(points.values[other])), values)
        lines.append(
            f'<tr style="{here}">' + "".join(
                f'<td style="padding-right: 0.8em">{escape(cell)}</td>' for cell in cells
            ) + "</tr>"
        )  # fmt: skip
    return block(f"<table>{''.join(lines)}</table>")


def _rows(rows: Iterable[tuple[str, str]]) -> str:
    """Names and HTML of their values as a table."""
    cells = "".join(
        f'<tr><td style="padding-right: 1em; opacity: 0.8">{escape(name)}</td><td>{value}</td></tr>'
        for name, value in rows
    )
    return f"<table>{cells}</table>"


def _shown(value: Any, most: int = 48) -> str:
    """A value in few letters."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Mapping):
        value = tuple(value.values())
    if isinstance(value, (list, tuple)):
        value = ", ".join(map(_shown, value))
    said = "–" if value is None else str(value)
    return said if len(said) <= most else f"…{said[1 - most :]}"


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
        """Show a point, with all that stand where it does, the best first, and the ranking."""
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
            self._controls.when(value, self._acts.rank_by)
        if len(bodies) > 1:
            body = gui.add_dropdown("points at", bodies, hint="where each body is at the points")
            self._controls.when(body, self._acts.stand)
        if bodies:
            part = gui.add_dropdown("in the scene", PARTS, hint="points that the scene shows")
            self._controls.when(part, self._acts.see)

    def _add_steps(self, gui: viser.GuiApi) -> None:
        """Add what goes from point to point."""
        count = len(self._points.ranking)
        self._rank = gui.add_slider(
            "best → worst", 1, max(count, 2), 1, 1, visible=count > 1,
            hint="solved points in the order of their value",
        )  # fmt: skip
        self._controls.when(self._rank, lambda rank: self._go_to_rank(int(rank) - 1))
        steps = gui.add_button_group("", STEPS, visible=count > 0)
        self._controls.clicked(steps, lambda: self._step(steps.value))
        self._place = gui.add_slider(
            "at this place", 1, 2, 1, 1, visible=False, hint="points that stand at one place"
        )
        self._controls.when(self._place, self._go_here)
        self._number = gui.add_number(
            "point", 0, min=0, max=len(self._points.table) - 1, step=1, hint="by its number"
        )
        self._controls.when(self._number, lambda number: self._acts.go(int(number)))

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

    def _go_here(self, number: float) -> None:
        """Show another point of the same place."""
        k = int(number) - 1
        if 0 <= k < len(self._here):
            self._acts.go(self._here[k])
