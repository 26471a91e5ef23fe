"""The interface of a command, its parser, and options that several commands have."""

from __future__ import annotations

import argparse
import math
import sys
from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, NoReturn, TypeAlias

from copose.commands.terminal.output import printing
from copose.errors import InputError, one_line, shown

if TYPE_CHECKING:
    from _typeshed import SupportsWrite


class CommandParser(argparse.ArgumentParser):
    """A parser whose mistakes are input errors of one line."""

    def error(self, message: str) -> NoReturn:
        """Raise an InputError: argparse would print its usage over several lines."""
        raise InputError(f"{one_line(message)} (see {self.prog} --help)")

    def print_help(self, file: SupportsWrite[str] | None = None) -> None:
        """Print the help whole: argparse would pass over a reader that has gone."""
        with printing():
            sys.stdout.write(self.format_help())


Commands: TypeAlias = "argparse._SubParsersAction[CommandParser]"
"""The commands of a parser, to which another can be added."""


class Command(ABC):
    """A command of `copose`; a new one is listed in `command_line.COMMANDS`.

    Attributes:
        name: the word behind `copose`.
        summary: what it does, a line of `copose --help`.
        example: arguments at the end of its own help.
        reads_problem: whether a problem file is its first argument.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    example: ClassVar[str]
    reads_problem: ClassVar[bool] = False

    def add_to(self, commands: Commands) -> None:
        """Add the command to those of a parser."""
        parser = commands.add_parser(
            self.name,
            help=self.summary,
            description=f"{self.summary[0].upper()}{self.summary[1:]}.",
            epilog=f"example:\n  copose {self.name} {self.example}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        parser.set_defaults(run=self.run)
        if self.reads_problem:
            _add_problem(parser)
        self.add_arguments(parser)

    @abstractmethod
    def add_arguments(self, parser: CommandParser) -> None:
        """Add the arguments that the command has beside the problem file."""

    @abstractmethod
    def run(self, arguments: argparse.Namespace) -> int:
        """Run the command and return its exit status.

        Raises:
            InputError: an argument, or a file that it names, is wrong.
        """


def _add_problem(parser: CommandParser) -> None:
    parser.add_argument("problem", type=Path, metavar="PROBLEM.toml", help="the problem file")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE",
        help="in place of the file's, such as arms.left.base.position.y=0.4; repeatable",
    )  # fmt: skip


def seed(text: str) -> int:
    """A seed, a whole number from 0 to 2⁶³ − 1."""
    if not text.isascii() or not text.isdigit() or int(text[:20]) >= 2**63:
        raise argparse.ArgumentTypeError(f"{shown(text)} is no whole number from 0 to 2⁶³ − 1")
    return int(text)


def count(text: str) -> int:
    """A whole number from 1."""
    if not text.isascii() or not text.isdigit() or not 1 <= int(text[:9]) < 10**8:
        raise argparse.ArgumentTypeError(f"{shown(text)} is no whole number from 1")
    return int(text)


def port(text: str) -> int:
    """A network port, a whole number from 0 to 65535."""
    largest = 65535
    number = int(text) if text.isascii() and text.isdigit() and len(text) < 6 else -1
    if not 0 <= number <= largest:
        raise argparse.ArgumentTypeError(f"{text!r} is no port, a whole number to {largest}")
    return number


def seconds(text: str) -> float:
    """A finite duration above zero, s."""
    try:
        duration = float(text)
    except ValueError:
        duration = math.nan
    if not 0 < duration < math.inf:
        raise argparse.ArgumentTypeError(f"{shown(text)} is no finite number of seconds above 0")
    return duration


def positive(text: str) -> float:
    """A finite number above zero."""
    values = _numbers(text)
    if len(values) != 1 or values[0] <= 0:
        raise argparse.ArgumentTypeError(f"{shown(text)} is no number above zero")
    return values[0]


def edges(text: str) -> list[float]:
    """The three edges of a box, ``X,Y,Z``, each above zero."""
    values = _numbers(text)
    if len(values) != 3 or min(values) <= 0:
        raise argparse.ArgumentTypeError(f"{shown(text)}: three numbers above zero are needed")
    return values


def named_numbers(text: str) -> tuple[str, list[float]]:
    """An arm and its joint positions, ``ARM=Q1,Q2,…``."""
    name, equals, values = text.partition("=")
    if not equals or not name:
        raise argparse.ArgumentTypeError(f"{shown(text)}: ARM=Q1,Q2,… is needed")
    return name, _numbers(values)


def _numbers(text: str) -> list[float]:
    try:
        values = [float(word) for word in text.split(",")]
    except ValueError:
        values = []
    if not values or not all(map(math.isfinite, values)):
        raise argparse.ArgumentTypeError(f"{shown(text)}: numbers apart by commas are needed")
    return values


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
