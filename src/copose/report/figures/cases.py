"""Pictures of the postures of several cases: a row for each time, a column for each case."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from copose.problem import SPACES
from copose.report import style
from copose.report.charts import legends
from copose.report.figures.planar import scale_bar
from copose.report.figures.titles import distance_words
from copose.report.geometry.free_ranges import ranges
from copose.report.rows import Row, case_of
from copose.report.scene import planar as planar_scene
from copose.report.scene import spatial as spatial_scene
from copose.report.style import Panel

# Columns that a picture has room for.
_COLUMNS = 4
# Inches: a scene's width and what is between two, a line of words, the margin at the sides.
_CELL, _BETWEEN, _LINE, _SIDE = 4.2, 0.25, 0.18, 0.2


def cases_figure(rows: list[Row], heading: str) -> Figure:
    """Scenes with their ellipsoids, at one scale."""
    found = dict.fromkeys(case_of(p.posture) for row in rows for p in row.panels)
    names = [name for name in found if name]
    shown = names[:_COLUMNS]
    if len(shown) < len(names):
        heading += f" (the first {len(shown)} of {len(names)} cases)"
    kept = [[p for p in row.panels if case_of(p.posture) in ("", *shown)] for row in rows]
    panels = [panel for some in kept for panel in some]
    planar = SPACES[panels[0].solution.problem.space].planar
    scenes: _Scenes = _PlanarScenes.of(panels) if planar else _SpatialScenes.of(panels)
    titles = [_title(panel) for panel in panels]
    # Axes in space have room for titles within them.
    lines = 1 + max(words.count("\n") for words in titles)
    above = 0.35 + _LINE * lines if planar else 0.45
    head = 0.45 + _LINE * len(scenes.words)
    row_tall = above + scenes.height + scenes.below
    wide = max(scenes.left + (_CELL + _BETWEEN) * len(shown) + _SIDE, 6.5)
    keys = scenes.keys + [legends.RANGES] * any(map(ranges, panels))
    columns, legend = legends.legend_grid(keys, wide - 2 * _SIDE)
    tall = head + row_tall * len(rows) + 0.25 + 0.27 * legend
    figure = Figure(figsize=(wide, tall))
    x = _SIDE / wide
    figure.suptitle(heading, fontweight="bold", x=x, y=1 - 0.1 / tall, ha="left", va="top")
    for k, (words, color) in enumerate(scenes.words):
        y = 1 - (0.42 + _LINE * k) / tall
        figure.text(x, y, words, fontsize=9.5, color=color, va="top")
    k = 0
    for i, (row, some) in enumerate(zip(rows, kept, strict=True)):
        top = tall - head - row_tall * i
        figure.text(x, (top - 0.05) / tall, _row_words(row), fontweight="bold", va="top")
        for panel in some:
            case = case_of(panel.posture)
            column = shown.index(case) if case else 0
            left = scenes.left + (_CELL + _BETWEEN) * column
            bottom = top - above - scenes.height
            place = (left / wide, bottom / tall, _CELL / wide, scenes.height / tall)
            ax = scenes.draw(figure, place, k, first=panel is some[0], last=panel is some[-1])
            ax.set_title(titles[k], loc="left", fontsize=10, y=None if planar else 0.92)
            k += 1
    handles, labels = figure.axes[0].get_legend_handles_labels()
    if planar:
        handles.append(Line2D([], [], color=style.INK, linewidth=1.4, linestyle="--"))
        labels.append(legends.ALONE)
    figure.legend(handles, labels, loc="lower center", ncols=columns, frameon=False)
    return figure


def _title(panel: Panel) -> str:
    words = style.value_words(panel.solution, panel.posture)
    return "\n".join(filter(None, (panel.name, words, distance_words(panel.posture, 16))))


def _row_words(row: Row) -> str:
    """Name, total and note."""
    solution = row.panels[0].solution
    first, objective = row.panels[0].posture, solution.objective
    earlier = any(first is case for case in solution.cases_before or ())
    value, unit = objective.before if earlier else objective.after, style.objective_unit(solution)
    total = f"Σ weight · {style.objective_name(solution)} = {style.three(value)} {unit}".rstrip()
    told = value is not None and bool(case_of(first))
    name = style.short(row.name, 40)
    return "; ".join(filter(None, (f"{name}: {total}" if told else name, row.note)))


@dataclass(frozen=True, eq=False)
class _SpatialScenes:
    """Scenes in space.

    Attributes:
        panels: all that are drawn.
        stage: what they share.
        words: lines at the top, and their colours.
        keys: entries of the legend.
        height: of a scene, inches, and what is ``left`` of all scenes and ``below`` each.
    """

    panels: list[Panel]
    stage: spatial_scene.Stage
    words: list[tuple[str, str]]
    keys: list[str]
    height: float = 4.2
    left: float = _SIDE
    below: float = 0.0

    @classmethod
    def of(cls, panels: list[Panel]) -> _SpatialScenes:
        """All at one scale."""
        stage = spatial_scene.Stage.of(panels)
        words = [(kind.words(panels), kind.color) for kind in stage.kinds]
        return cls(panels, stage, words, legends.keys(panels[0].solution.joint_names))

    def draw(
        self, figure: Figure, place: tuple[float, float, float, float], k: int, **_: bool
    ) -> Any:
        """One of them."""
        ax: Any = figure.add_axes(place, projection="3d")
        self.stage.draw(ax, self.panels, k, whole=True)
        # What labels stick out by is not to be covered by the next.
        ax.patch.set_visible(False)
        return ax


@dataclass(frozen=True, eq=False)
class _PlanarScenes:
    """Scenes in the plane; attributes as those in space have them, and the axes' limits."""

    panels: list[Panel]
    stage: planar_scene.Stage
    low: Any
    high: Any
    words: list[tuple[str, str]]
    keys: list[str]
    height: float
    left: float = 0.7
    below: float = 0.85

    @classmethod
    def of(cls, panels: list[Panel]) -> _PlanarScenes:
        """All at one scale."""
        stage = planar_scene.Stage.of(panels)
        low, high = stage.frame(panels, [])
        width, height = high - low
        keys = legends.keys(panels[0].solution.joint_names, legends.TOGETHER, legends.ALONE)
        return cls(panels, stage, low, high, [], keys, _CELL * min(height / width, 1.3))

    def draw(
        self, figure: Figure, place: tuple[float, float, float, float], k: int, **at: bool
    ) -> Any:
        """One of them; the first of a row is labelled, the last has a scale beside it."""
        ax: Any = figure.add_axes(place)
        self.stage.draw(ax, self.panels, k, self.low, self.high)
        ax.set_xlabel("x, m")
        ax.tick_params(labelsize=9, labelleft=at["first"])
        if at["first"]:
            ax.set_ylabel("y, m")
        unit, final = (style.units(self.panels[j].solution)[0] for j in (k, -1))
        if self.stage.scales and at["last"] and (k + 1 == len(self.panels) or unit != final):
            scale_bar(ax, self.low, self.high, self.stage.scales[k], unit)
        return ax


_Scenes = _SpatialScenes | _PlanarScenes
