"""A study and its points in words, as HTML for the panel."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from html import escape
from typing import Any

from copose.live.panels.markup import block
from copose.live.studies.point_cloud import CLOUD
from copose.live.studies.study_points import StudyPoints
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
    """A point: number, rank, status, reason, objective, values and what was recorded.

    Args:
        points: of the study.
        line: of the point.
        title: name of the objective with its unit.
    """
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
