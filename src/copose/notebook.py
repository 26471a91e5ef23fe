"""Problems and results as HTML: the tables of the commands and their pictures, in one piece."""

from __future__ import annotations

import base64
import io
from html import escape

from rich.console import Console, Group, RenderableType
from rich.text import Text

from copose.errors import InputError
from copose.motion import described
from copose.posture.inspection import check
from copose.problem import Problem
from copose.report.figures.files import figure, saved, starts_figure
from copose.report.text import chains, motion_table, solution_table
from copose.results import Motion, Solution


def html(shown: Problem | Solution | Motion) -> str:
    """The HTML of a table and, where there is something to draw, a picture; all names escaped."""
    if isinstance(shown, Problem):
        return _problem(shown)
    if isinstance(shown, Motion):
        table, drawn = motion_table(shown), shown.knots is not None
    else:
        table, drawn = solution_table(shown), bool(shown.after or shown.cases)
    picture = _picture(saved(figure(shown), "png"), shown.problem.name) if drawn else ""
    return _table(table) + picture


def _problem(problem: Problem) -> str:
    try:
        checked = check(problem)
        path = described(problem, checked.arms)
    except InputError as error:
        return _table(Group(Text(problem.name), Text(str(error))))
    picture = saved(starts_figure(problem, checked.starts), "png")
    return _table(chains(problem, checked.starts, checked.notes, path)) + _picture(
        picture, problem.name
    )


def _table(content: RenderableType) -> str:
    console = Console(
        file=io.StringIO(), record=True, width=100, highlight=False, force_jupyter=False
    )
    console.print(content)
    style = "line-height: 1.2; white-space: pre; overflow-x: auto"
    return console.export_html(
        inline_styles=True, code_format=f'<pre style="{style}">{{code}}</pre>'
    )


def _picture(content: bytes, name: str) -> str:
    data = base64.b64encode(content).decode()
    return f'<img style="max-width: 100%" alt="{escape(name)}" src="data:image/png;base64,{data}">'
