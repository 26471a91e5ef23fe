"""A study as tables on a terminal."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from rich.console import RenderableType

from copose.report.studies.key_axes import in_lines, titled, value_words
from copose.report.studies.map_content import Ending, MapContent, StudyPlaces
from copose.report.text.columns import counted, heading, lines, sections, table
from copose.report.words import short, three
from copose.studies.table import StudyTable


@dataclass(frozen=True)
class StudyTableLook:
    """Sizes of tables of a study, which fit on one screen."""

    beside: int = 4  # points beside one another
    keys: int = 12  # keys at most
    record: int = 8  # recorded numbers at most
    letters: int = 11  # of a name among numbers


def study_table(study: StudyTable, most: int = 4) -> RenderableType:
    """The tables of a study: what has become of its points, and the best of them.

    Args:
        study: the table.
        most: number of the best points that are told.
    """
    content = MapContent.of(study)
    parts: list[RenderableType] = [heading(study.study.file.name, content.counts())]
    parts += lines(_told(content))
    parts += _without_number(content)
    parts += lines(_reasons(content))
    places = _best_places(content, most)
    for begin in range(0, len(places), StudyTableLook.beside):
        parts.append(_best(content, places[begin : begin + StudyTableLook.beside], begin))
    return sections(parts)


def _told(content: MapContent) -> Iterator[tuple[str, str]]:
    """Lines on values, seeds and times."""
    values = content.places.values[content.places.solved]
    if values.size:
        low, middle, high = (three(float(x)) for x in np.quantile(values, [0, 0.5, 1]))
        mean = three(float(values.mean()))
        yield f"{content.title}:", f"from {low} to {high}, mean {mean}, median {middle}"
    seeds = content.seeds_told()
    if seeds:
        yield "seeds:", seeds
    seconds = content.table.seconds[np.isfinite(content.table.seconds)]
    if seconds.size:
        mean, largest = three(float(seconds.mean())), three(float(seconds.max()))
        tried = counted(len(seconds), "search", "searches")
        total = _duration(float(seconds.sum()))
        yield "time:", f"{total} in {tried}: {mean} s on average, {largest} s at most"


def _reasons(content: MapContent, longest: int = 150) -> Iterator[tuple[str, str]]:
    """The reason of the first point of what no arm is to blame for."""
    for code, ending in enumerate(content.places.endings):
        here = np.flatnonzero(content.places.codes == code)
        if ending.arms or ending.status in ("solved", "missing") or not len(here):
            continue
        point = int(content.places.points[here[0]])
        line = content.table.line(point)
        if line is not None:
            yield f"point {point}:", f"{ending.status}: {short(str(line['reason']), longest)}"


def _duration(seconds: float) -> str:
    """A time in seconds, minutes or hours."""
    if seconds < 120:
        return f"{three(seconds)} s"
    return f"{seconds / 60:.1f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


def _without_number(content: MapContent) -> list[RenderableType]:
    """How many points have no number, and why; no table where all have one."""
    rows = [
        (_ending_words(ending, len(content.arms)), f"{count:,}")
        for ending, count in content.places.counted().items()
        if ending.status != "solved"
    ]
    return [table(("no posture", "points"), rows)] if rows else []


def _ending_words(ending: Ending, arms: int) -> str:
    words = ending.words(arms)
    return words if words in (ending.status, "not done yet") else f"{ending.status}: {words}"


def _best_places(content: MapContent, count: int) -> list[int]:
    """The places with the largest numbers, the best first; none where kinds differ."""
    if content.best is None:
        return []
    values = np.where(content.places.solved, content.places.values, -np.inf)
    order = np.argsort(-values, kind="stable")[:count]
    return [int(place) for place in order if content.places.solved[place]]


def _best(content: MapContent, places: list[int], begin: int) -> RenderableType:
    """Some of the best places beside one another: numbers, then the values of the keys."""
    names = [content.places.name, *(n for n in content.table.numbers if n != content.places.name)]
    shown, keys = names[: 1 + StudyTableLook.record], content.axes[: StudyTableLook.keys]
    rows = [_row(content.places.showing(name), name, places) for name in shown]
    for axis in keys:
        along = content.along(axis)
        cells = (axis.value(float(along[place])) for place in places)
        rows.append([axis.title, *(in_lines(cell, StudyTableLook.letters) for cell in cells)])
    if len(content.axes) > StudyTableLook.keys:
        rows.append(
            [f"and {len(content.axes) - StudyTableLook.keys} more keys", *[""] * len(places)]
        )
    points = content.places.points[places].tolist()
    rows.append(["point", *map(str, points)])
    seeds = content.table.study.points.seeds
    if len(seeds) > 1:
        rows.append(["seed", *(str(seeds[point % len(seeds)]) for point in points)])
    numbers = range(begin + 1, begin + len(places) + 1)
    titles = [content.best_word if n == 1 else _ordinal(n) for n in numbers]
    return table(("", *titles), rows)


def _ordinal(number: int) -> str:
    """2nd, 3rd, 4th."""
    ending = {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")
    return f"{number}{'th' if number % 100 in (11, 12, 13) else ending}"


def _row(places: StudyPlaces, name: str, shown: list[int]) -> list[str]:
    """A number of some places."""
    values = places.values[shown].tolist()
    return [
        titled(*value_words(places.table.study, name)),
        *(three(value) if np.isfinite(value) else "–" for value in values),
    ]
