"""The command line of `copose`: the table of its commands, and `main`, which runs one."""

from __future__ import annotations

import contextlib
import io
import os
import sys
import time
from collections.abc import Sequence

from copose.commands.comparison import CompareCommand
from copose.commands.documents import ManualCommand, SchemaCommand
from copose.commands.export_file import ExportCommand
from copose.commands.live_page import LiveCommand
from copose.commands.motion import PathCommand
from copose.commands.new_problem import InitCommand
from copose.commands.posture import EvaluateCommand, SolveCommand
from copose.commands.start_check import CheckCommand
from copose.commands.study import StudyCommand
from copose.commands.terminal.output import printing, tell
from copose.commands.terminal.parser import Command, CommandParser
from copose.errors import CoposeError, InputError
from copose.interrupt import ExitStatus
from copose.version import __version__

# In the order in which `copose --help` lists them.
COMMANDS: tuple[type[Command], ...] = (
    InitCommand,
    SolveCommand,
    EvaluateCommand,
    PathCommand,
    StudyCommand,
    CompareCommand,
    ExportCommand,
    LiveCommand,
    SchemaCommand,
    ManualCommand,
    CheckCommand,
)


def main(argv: Sequence[str] | None = None, *, began: float | None = None) -> int:
    """Run a command line and return its exit status.

    Args:
        argv: the command line; default that of the process.
        began: when the command did, on the clock of `time.perf_counter`; default now.
    """
    began = time.perf_counter() if began is None else began
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            with contextlib.suppress(ValueError):
                stream.reconfigure(errors="replace")
    try:
        try:
            parser = command_parser()
            _complete(parser)
            arguments = parser.parse_args(argv)
        except SystemExit:
            # After --help and --version: mistakes are input errors here.
            with printing():
                return ExitStatus.SOLVED
        arguments.began = began
        status: int = arguments.run(arguments)
        return status
    except InputError as error:
        tell(str(error))
        return ExitStatus.WRONG_INPUT
    except CoposeError as error:
        tell(str(error))
        return ExitStatus.FAILED
    except BrokenPipeError:
        return ExitStatus.READER_GONE


def command_parser() -> CommandParser:
    """The parser of all commands."""
    parser = CommandParser(
        prog="copose",
        description="The most dexterous posture of several robot arms holding one object together.",
    )
    parser.add_argument("--version", action="version", version=f"copose {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=CommandParser)
    for command in COMMANDS:
        command().add_to(commands)
    return parser


def _complete(parser: CommandParser) -> None:
    """Answer a shell that completes a line, if it is one that asks, and end the process."""
    if "_ARGCOMPLETE" in os.environ:
        with contextlib.suppress(ImportError):
            import argcomplete

            argcomplete.autocomplete(parser)
