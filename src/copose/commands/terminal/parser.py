"""The interface of a command, and the parser that its arguments are added to."""

from __future__ import annotations

import argparse
import sys
from abc import ABC, abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, NoReturn, TypeAlias

from copose.commands.terminal.output import printing
from copose.errors import InputError, one_line

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
