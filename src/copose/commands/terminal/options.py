"""Options that several commands share."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from copose.commands.terminal.number_types import port, seconds, seed


def add_outputs(parser: argparse.ArgumentParser, files: Sequence[str], figure: str) -> None:
    """Add where an answer is written, as files of these names, and how it is shown.

    ``figure`` is the help of ``--figure``.
    """
    *earlier, last = files
    parser.add_argument(
        "-o", "--output", type=Path, metavar="DIR",
        help=f"folder for {', '.join(earlier)} and {last} (default: the problem's name)",
    )  # fmt: skip
    parser.add_argument("--figure", type=Path, metavar="FILE", help=figure)
    add_style(parser)
    add_verbosity(parser)
    parser.add_argument("--json", action="store_true", help="print the result instead of a table")


def add_style(parser: argparse.ArgumentParser) -> None:
    """Add how pictures show arms in space."""
    parser.add_argument(
        "--style", choices=("bodies", "sticks"), default="bodies",
        help="how pictures show arms in space (default: bodies)",
    )  # fmt: skip


def add_search(parser: argparse.ArgumentParser) -> None:
    """Add the seed and the time limit of a search."""
    parser.add_argument("--seed", type=seed, metavar="N", help="in place of the file's seed")
    parser.add_argument(
        "--time-limit", type=seconds, metavar="S",
        help="the best found S seconds after the command began, writing apart",
    )  # fmt: skip


def add_objective(parser: argparse.ArgumentParser) -> None:
    """Add an objective and its direction in place of the file's."""
    parser.add_argument("--objective", metavar="KIND", help="in place of the file's")
    parser.add_argument(
        "--direction", nargs="+", type=float, metavar="NUMBER",
        help="of the objective; three in space are linear; alone: task-compatibility",
    )  # fmt: skip


def add_verbosity(parser: argparse.ArgumentParser) -> None:
    """Add how much is told while the command runs."""
    verbosity = parser.add_mutually_exclusive_group()
    verbosity.add_argument("--quiet", action="store_true", help="print no table, show no progress")
    verbosity.add_argument(
        "--verbose", action="store_true",
        help="tell more of the search, and print a line a stage on stderr",
    )  # fmt: skip


def add_page(parser: argparse.ArgumentParser) -> None:
    """Add where a page is served."""
    parser.add_argument(
        "--port", type=port, default=8080, metavar="N", help="of the page (default: 8080)"
    )
    parser.add_argument(
        "--host", default="127.0.0.1", metavar="ADDRESS",
        help="of the page (default: 127.0.0.1, which no other machine reaches)",
    )  # fmt: skip
    parser.add_argument(
        "--no-browser", action="store_true", help="do not open the page in the browser"
    )
