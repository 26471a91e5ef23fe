"""Tables of one look."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest

from rich.table import Table

from copose.report import style
from copose.results import Solution


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
