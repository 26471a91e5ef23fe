"""Tables of one look."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest

from rich.table import Table
from rich.text import Text

from copose.report import style
from copose.report.style import Answer
from copose.results import Solution


def heading(name: str, text: str) -> Text:
    """What stands above tables."""
    return Text.assemble((name, "bold"), f": {text}")


def status_line(answer: Answer) -> Text:
    """How a result ended, and why."""
    said = ": ".join(filter(None, (answer.status, answer.reason)))
    return heading(answer.problem.name, said)


def note_lines(notes: Sequence[str]) -> list[Text]:
    """What stands below tables."""
    return [Text(f"note: {note}", style="dim") for note in notes]


def counted(count: int, one: str, many: str | None = None) -> str:
    """A number of things, ``1,024 postures``."""
    return f"{count:,} {one if count == 1 else many or one + 's'}"


def plain_table(*titles: str) -> Table:
    """Columns without a frame."""
    table = Table(show_edge=False, pad_edge=False)
    for title in titles:
        table.add_column(title)
    return table


def compared_table(solution: Solution, title: str) -> Table:
    """A column for each posture, between names and words."""
    table = plain_table(title)
    if style.compared(solution):
        table.add_column("before", justify="right")
    table.add_column(style.now(solution), justify="right")
    table.add_column("")
    return table


def aligned(rows: Sequence[Sequence[str]], gap: str) -> list[str]:
    """Rows of words as lines in which the words stand below one another, flush right."""
    widths = [max(map(len, words)) for words in zip_longest(*rows, fillvalue="")]
    return [gap.join(map(str.rjust, row, widths)) for row in rows]
