"""Parts of HTML of which the panel's numbers are made."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

SMALL = "font-size: 0.8em; line-height: 1.35; padding: 0 0.8em"
"""Style of a block of numbers."""


def block(content: str) -> str:
    """HTML as far from the edges as numbers are."""
    return f'<div style="{SMALL}">{content}</div>'


def line(words: str) -> str:
    """A line of words."""
    return f'<div style="{SMALL}">{escape(words)}</div>'


def titled_table(title: str, rows: Iterable[tuple[str, str]], below: str, key: str) -> str:
    """Numbers under a title.

    Args:
        title: the title.
        rows: names, and HTML of their numbers.
        below: HTML below them.
        key: beginning of the identifiers of cells; the last word of the name follows.
    """
    cells = "".join(
        f'<tr><td style="padding-right: 1em">{name}</td>'
        f'<td id="{key}-{name.split()[-1]}">{value}</td></tr>'
        for name, value in rows
    )
    return (
        f'<div style="{SMALL}"><div style="font-size: 1.1em"><b>{escape(title)}</b></div>'
        f"<table>{cells}</table>{below}</div>"
    )


def message(words: str, colour: str, key: str) -> str:
    """A line of words in colour, with an identifier that begins with a key."""
    return f'<div id="{key}-message" style="color: {colour}">{escape(words)}</div>'
