"""Pictures of the postures of several cases: a row for each time, a column for each case."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from copose.poses import Array
from copose.problem import SPACES
from copose.report.charts.legends import Entry, legend_entries, legend_grid
from copose.report.figures.planar import scale_bar
from copose.report.geometry.shapes import ranges
from copose.report.look import LOOK
from copose.report.panels import Panel, Row, case_of, distance_words
from copose.report.scene.planar import PlanarStage
from copose.report.scene.spatial import SpatialStage
from copose.report.words import (
    objective_name,
    objective_unit,
    semi_axis_units,
    short,
    three,
    value_words,
)


@dataclass(frozen=True)
class CasesLook:
    """Sizes of a picture of cases, inches but for the first."""

    columns: int = 4  # cases that there is room for
    cell: float = 4.2  # width of a scene
    between: float = 0.25  # between two scenes
    line: float = 0.18  # height of a line of words
    side: float = 0.2  # margin at the sides


def cases_figure(rows: list[Row], heading: str) -> Figure:
    """Scenes with their ellipsoids, at one scale."""
    cases = dict.fromkeys(case_of(p.posture) for row in rows for p in row.panels)
    names = [name for name in cases if name]
    shown = names[: CasesLook.columns]
    if len(shown) < len(names):
        heading += f" (the first {len(shown)} of {len(names)} cases)"
    kept = [[p for p in row.panels if case_of(p.posture) in ("", *shown)] for row in rows]
    panels = [panel for row in kept for panel in row]
    planar = SPACES[panels[0].solution.problem.space].planar
    scenes = (_PlanarScenes if planar else _SpatialScenes)(panels)
    titles = [_title(panel) for panel in panels]
    # Axes in space have room for titles within them.
    lines = 1 + max(words.count("\n") for words in titles)
    above = 0.35 + CasesLook.line * lines if planar else 0.45
    head = 0.45 + CasesLook.line * len(scenes.words)
    row_tall = above + scenes.height + scenes.below
    wide = max(
        scenes.left + (CasesLook.cell + CasesLook.between) * len(shown) + CasesLook.side, 6.5
    )
    entries = scenes.entries + [Entry.RANGES] * any(map(ranges, panels))
    columns, legend_rows = legend_grid(entries, wide - 2 * CasesLook.side)
    tall = head + row_tall * len(rows) + 0.25 + 0.27 * legend_rows
    figure = Figure(figsize=(wide, tall))
    x = CasesLook.side / wide
    figure.suptitle(heading, fontweight="bold", x=x, y=1 - 0.1 / tall, ha="left", va="top")
    for k, (words, color) in enumerate(scenes.words):
        y = 1 - (0.42 + CasesLook.line * k) / tall
        figure.text(x, y, words, fontsize=9.5, color=color, va="top")
    k = 0
    for i, (row, row_panels) in enumerate(zip(rows, kept, strict=True)):
        top = tall - head - row_tall * i
        figure.text(x, (top - 0.05) / tall, _row_words(row), fontweight="bold", va="top")
        for panel in row_panels:
            case = case_of(panel.posture)
            column = shown.index(case) if case else 0
            left = scenes.left + (CasesLook.cell + CasesLook.between) * column
            bottom = top - above - scenes.height
            place = (left / wide, bottom / tall, CasesLook.cell / wide, scenes.height / tall)
            first, last = panel is row_panels[0], panel is row_panels[-1]
            ax = scenes.draw(figure, place, k, first=first, last=last)
            ax.set_title(titles[k], loc="left", fontsize=10, y=None if planar else 0.92)
            k += 1
    handles, labels = figure.axes[0].get_legend_handles_labels()
    if planar:
        handles.append(Line2D([], [], color=LOOK.ink, linewidth=1.4, linestyle="--"))
        labels.append(Entry.ALONE)
    figure.legend(handles, labels, loc="lower center", ncols=columns, frameon=False)
    return figure


def _title(panel: Panel) -> str:
    """A case, its value, and the nearest bodies."""
    words = value_words(panel.solution, panel.posture)
    return "\n".join(filter(None, (panel.name, words, distance_words(panel.posture, 16))))


def _row_words(row: Row) -> str:
    """A row's name, total and note."""
    solution = row.panels[0].solution
    first, objective = row.panels[0].posture, solution.objective
    earlier = any(first is case for case in solution.cases_before or ())
    value, unit = objective.before if earlier else objective.after, objective_unit(solution)
    total = f"Σ weight · {objective_name(solution)} = {three(value)} {unit}".rstrip()
    name = short(row.name, 40)
    known = value is not None and bool(case_of(first))
    return "; ".join(filter(None, (f"{name}: {total}" if known else name, row.note)))


class _SpatialScenes:
    """Scenes in space at one scale.

    Attributes:
        words: lines at the top, and their colours.
        entries: entries of the legend.
        height: height of a scene, inches.
        left: width of what is left of all scenes, inches.
        below: height of what is below each, inches.
    """

    def __init__(self, panels: list[Panel]) -> None:
        self._panels, self._stage = panels, SpatialStage.of(panels)
        self.words = [(kind.words(panels), kind.color) for kind in self._stage.kinds]
        self.entries = legend_entries(panels[0].solution.joint_names)
        self.height, self.left, self.below = 4.2, CasesLook.side, 0.0

    def draw(
        self, figure: Figure, place: tuple[float, float, float, float], k: int, *,
        first: bool, last: bool,
    ) -> Any:  # fmt: skip
        """Axes of one of them; ``first`` or ``last`` of its row."""
        ax: Any = figure.add_axes(place, projection="3d")
        self._stage.draw(ax, self._panels, k, whole=True)
        # What labels stick out by is not to be covered by the next.
        ax.patch.set_visible(False)
        return ax


class _PlanarScenes:
    """Scenes in the plane at one scale, with the attributes of those in space."""

    words: tuple[tuple[str, str], ...] = ()
    left: float = 0.7
    below: float = 0.85

    def __init__(self, panels: list[Panel]) -> None:
        self._panels, self._stage = panels, PlanarStage.of(panels)
        self._low, self._high = self._stage.frame(panels, [])
        width, height = self._high - self._low
        arms = panels[0].solution.joint_names
        self.entries = legend_entries(arms, Entry.TOGETHER, Entry.ALONE)
        self.height = CasesLook.cell * min(height / width, 1.3)

    def draw(
        self, figure: Figure, place: tuple[float, float, float, float], k: int, *,
        first: bool, last: bool,
    ) -> Any:  # fmt: skip
        """Axes of one of them; the first of a row is labelled, the last has a scale beside it."""
        ax: Any = figure.add_axes(place)
        low: Array = self._low
        self._stage.draw(ax, self._panels, k, low, self._high)
        ax.set_xlabel("x, m")
        ax.tick_params(labelsize=9, labelleft=first)
        if first:
            ax.set_ylabel("y, m")
        unit, final = (semi_axis_units(self._panels[j].solution)[0] for j in (k, -1))
        if self._stage.scales and last and (k + 1 == len(self._panels) or unit != final):
            scale_bar(ax, low, self._high, self._stage.scales[k], unit)
        return ax
