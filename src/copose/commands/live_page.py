"""The command `copose live`: a page in the browser, until ^C."""

from __future__ import annotations

import argparse

from copose.commands.terminal.interrupts import serve
from copose.commands.terminal.output import watching
from copose.commands.terminal.parser import (
    Command,
    CommandParser,
    add_objective,
    add_page,
    add_verbosity,
)
from copose.commands.terminal.problem_input import load_problem


class LiveCommand(Command):
    """`copose live`: a page in the browser, until ^C."""

    name = "live"
    summary = "a page in the browser: drag the object, the arms follow"
    example = "problems/two-panda-box.toml --port 8081"
    reads_problem = True

    def add_arguments(self, parser: CommandParser) -> None:
        """See `Command.add_arguments`."""
        add_page(parser)
        add_objective(parser)
        add_verbosity(parser)

    def run(self, arguments: argparse.Namespace) -> int:
        """See `Command.run`."""
        with watching(arguments):
            from copose.live.handle import check_installed

            check_installed()
            problem = load_problem(arguments)
        from copose.live import open_live

        return serve(open_live, problem, arguments)
