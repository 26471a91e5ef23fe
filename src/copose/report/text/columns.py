"""Tables of one look, none wider than 80 columns while names are of the usual length."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import takewhile, zip_longest

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from copose.report.words import Answer
from copose.results import Timing


def heading(name: str, text: str) -> Text:
    """The line above tables: a name, and a text on it."""
    return Text.assemble((name, "bold"), f": {text}")


def answer_page(answer: Answer, tables: Iterable[RenderableType], evidence: Iterable[str]) -> Group:
    """A result: its status, its tables, its notes, and lines on how it was found."""
    status = heading(answer.problem.name, ": ".join(filter(None, (answer.status, answer.reason))))
    return sections([status, *tables, *note_lines(answer.notes), *map(Text, evidence)])


def sections(parts: Iterable[RenderableType]) -> Group:
    """Lines and tables one below the other, an empty line before and after every table."""
    stacked: list[RenderableType] = []
    after = False
    for part in parts:
        if after or (stacked and isinstance(part, Table)):
            stacked.append("")
        stacked.append(part)
        after = isinstance(part, Table)
    return Group(*stacked)


def lines(pairs: Iterable[tuple[str, str]], style: str = "") -> list[Table]:
    """Sentences, each beside its subject in a line of its own; no table where there is none."""
    grid = Table.grid(padding=(0, 1))
    for about, sentence in pairs:
        grid.add_row(Text(about, style), Text(sentence, style))
    return [grid] if grid.row_count else []


def note_lines(notes: Sequence[str]) -> list[Table]:
    """Notes below tables."""
    return lines((("note:", note) for note in notes), "dim")


def counted(count: int, one: str, many: str | None = None) -> str:
    """A number of things, ``1,024 postures``."""
    return f"{count:,} {one if count == 1 else many or one + 's'}"


def times(count: int) -> str:
    """A number of times: ``once``, ``3 times``."""
    return {1: "once", 2: "twice"}.get(count, f"{count:,} times")


def table(titles: Sequence[str], rows: Iterable[Sequence[str | Text]]) -> Table:
    """Rows of words without a frame: names in the first column, which may be wrapped as columns
    without a title may; numbers below their titles, flush right.
    """
    grid = Table(show_edge=False, pad_edge=False)
    for k, title in enumerate(titles):
        words = k == 0 or not title
        grid.add_column(
            Text(title), justify="left" if words else "right", no_wrap=not words, overflow="fold"
        )
    for row in rows:
        grid.add_row(*(Text(cell) if isinstance(cell, str) else cell for cell in row))
    return grid


def aligned(rows: Sequence[Sequence[str]], gap: str) -> list[str]:
    """Rows of words as lines in which the words stand below one another, flush right."""
    widths = [max(map(len, words)) for words in zip_longest(*rows, fillvalue="")]
    return [gap.join(map(str.rjust, row, widths)) for row in rows]


def joint_table(
    joints: Mapping[str, Sequence[str]], columns: Mapping[str, Mapping[str, Sequence[str | Text]]]
) -> Table:
    """A row for each joint, below one with the arm's name and what its joints' names begin with."""
    rows: list[list[str | Text]] = []
    for arm, names in joints.items():
        begin = shared_beginning(names)
        rows.append([Text(f"{arm}: {begin}*" if begin else arm, "bold"), *[""] * len(columns)])
        parts = (column[arm] for column in columns.values())
        for name, *cells in zip(names, *parts, strict=True):
            rows.append([f"  {name.removeprefix(begin)}", *cells])
    return table(("joint, rad or m", *columns), rows)


def shared_beginning(names: Sequence[str]) -> str:
    """The common beginning of names, up to a number or with the sign that ends a word."""
    if len(names) < 2:
        return ""
    alike = takewhile(lambda letters: len(set(letters)) == 1, zip(*names, strict=False))
    begin = "".join(letters[0] for letters in alike).rstrip("0123456789")
    if all(name[len(begin) :][:1].isdigit() for name in names):
        return begin
    return re.sub(r"[^_./-]*$", "", begin)


def timing_line(timing: Timing) -> str:
    """The times that building and searching took."""
    searched = f"searched {timing.search_s:.2f} s ({timing.kernels})"
    return f"built in {timing.build_s:.2f} s, {searched}"
