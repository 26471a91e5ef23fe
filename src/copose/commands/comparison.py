"""The command `copose compare`: two results side by side."""

from __future__ import annotations

import argparse
from pathlib import Path

from copose.commands.terminal.answer import spared
from copose.commands.terminal.output import print_place, print_rich, watching
from copose.commands.terminal.parser import Command, CommandParser, add_style, add_verbosity
from copose.commands.terminal.problem_input import check_place
from copose.interrupt import ExitStatus
from copose.progress import stage


class CompareCommand(Command):
    """`copose compare`: two results side by side."""

    name = "compare"
    summary = "two results side by side"
    example = "panda/result.json worst/result.json --figure compare.pdf"

    def add_arguments(self, parser: CommandParser) -> None:
        """See `Command.add_arguments`."""
        parser.add_argument("one", type=Path, metavar="A.json")
        parser.add_argument("other", type=Path, metavar="B.json")
        parser.add_argument(
            "--figure", type=Path, metavar="FILE", default=Path("compare.png"),
            help="the picture, a .png, .pdf or .svg (default: compare.png)",
        )  # fmt: skip
        add_style(parser)
        add_verbosity(parser)

    def run(self, arguments: argparse.Namespace) -> int:
        """See `Command.run`."""
        with watching(arguments):
            from copose.report import check_format, compare, draw_comparison
            from copose.results import read_solution

            check_format(arguments.figure)
            check_place(arguments.figure)
            files = arguments.one, arguments.other
            one, other = (read_solution(file) for file in files)
            comparison = compare(one, other, (str(files[0]), str(files[1])))
            stage("drawing")
            with spared(arguments.figure):
                draw_comparison(comparison, arguments.figure, arguments.style)
        if not arguments.quiet:
            from copose.report.text import comparison_table

            print_rich(comparison_table(comparison))
            print_place(arguments.figure)
        return ExitStatus.SOLVED
