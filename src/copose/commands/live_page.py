"""The command `copose live`: a page in the browser, until ^C."""

from __future__ import annotations

import argparse
import signal
import time
from typing import TYPE_CHECKING

from copose.commands.terminal.number_types import port
from copose.commands.terminal.options import add_objective, add_verbosity
from copose.commands.terminal.output import print_line, tell
from copose.commands.terminal.parser import Command, CommandParser
from copose.commands.terminal.problem_input import load_problem
from copose.commands.terminal.progress_line import watching
from copose.interrupt import ExitStatus

if TYPE_CHECKING:
    from copose.problem import Problem


class LiveCommand(Command):
    """`copose live`: a page in the browser, until ^C."""

    name = "live"
    summary = "a page in the browser: drag the object, the arms follow"
    example = "problems/two-panda-box.toml --port 8081"
    reads_problem = True

    def add_arguments(self, parser: CommandParser) -> None:
        """See `Command.add_arguments`."""
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
        add_objective(parser)
        add_verbosity(parser)

    def run(self, arguments: argparse.Namespace) -> int:
        """See `Command.run`."""
        with watching(arguments):
            from copose.live.handle import check_installed

            check_installed()
            problem = load_problem(arguments)
        _serve(problem, arguments)
        return ExitStatus.INTERRUPTED


def _serve(problem: Problem, arguments: argparse.Namespace) -> None:
    """Serve the page of a problem until ^C.

    Raises:
        InputError: the problem cannot be used, or the port is taken.
    """
    from copose.live import open_live

    page = open_live(
        problem, host=arguments.host, port=arguments.port, browser=not arguments.no_browser
    )
    # A handler may come in the middle of anything: it takes no lock.
    interrupts: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: interrupts.append(number))
    print_line(f"open at {page.address}; ^C ends it")
    while not interrupts:
        # Between two looks at whether ^C was pressed, s.
        time.sleep(0.2)
    page.stop()
    tell("interrupted: the page is closed")
