"""The command `copose check`: what a problem file and its robots say, nothing solved."""

from __future__ import annotations

import argparse
from pathlib import Path

from copose.commands.terminal.answer import spared
from copose.commands.terminal.output import in_short, print_line, print_place, print_rich, watching
from copose.commands.terminal.parser import Command, CommandParser, add_style, add_verbosity
from copose.commands.terminal.problem_input import check_place, load_problem
from copose.errors import InputError
from copose.interrupt import ExitStatus
from copose.progress import stage


class CheckCommand(Command):
    """`copose check`: what a problem file and its robots say, nothing solved."""

    name = "check"
    summary = "read the file and the robots, and print the chains"
    example = "problems/two-panda-box.toml --figure start.png"
    reads_problem = True

    def add_arguments(self, parser: CommandParser) -> None:
        """See `Command.add_arguments`."""
        parser.add_argument(
            "--figure", type=Path, metavar="FILE",
            help="draw bodies and frames at the start into a .png, .pdf or .svg",
        )  # fmt: skip
        add_style(parser)
        add_verbosity(parser)

    def run(self, arguments: argparse.Namespace) -> int:
        """See `Command.run`."""
        from copose.problem import is_study, read_tables

        if is_study(read_tables(arguments.problem)):
            return _check_study(arguments)
        with watching(arguments):
            from copose.motion import described
            from copose.posture.inspection import check
            from copose.report import check_format, draw_start
            from copose.report.text import chains

            figure = arguments.figure
            if figure is not None:
                check_format(figure)
                check_place(figure)
            problem = load_problem(arguments)
            checked = check(problem)
            path = described(problem, checked.arms)
            if figure is not None:
                stage("drawing")
                with spared(figure):
                    draw_start(problem, checked.starts, figure, arguments.style)
        print_rich(chains(problem, checked.starts, checked.notes, path))
        if figure is not None:
            print_place(figure)
        return ExitStatus.SOLVED


def _check_study(arguments: argparse.Namespace) -> int:
    """Check a study, and print how many points it has and how long they take."""
    for option in ("figure", "set"):
        if getattr(arguments, option):
            raise InputError(f"--{option} is of a problem, not of a study", file=arguments.problem)
    with watching(arguments):
        from copose.batch import check_study, estimate
        from copose.studies import Study

        study = Study.read(arguments.problem)
        stage("checking every value")
        check_study(study)
        estimated = estimate(study)
    seeds = len(study.points.seeds)
    each = f", {seeds} seeds each," if seeds > 1 else ""
    count = len(study.points) // seeds
    print_line(f"{study.file.name}: {count} points{each} of {study.problems.file}")
    for axis in study.points.axes:
        values = "a range" if axis.rows is None else f"{len(axis.rows)} values"
        print_line(f"  {axis.label}: {values}")
    tried = ", ".join(in_short(each) for each in estimated.point_s)
    print_line(
        f"about {in_short(estimated.total_s)} in one process: {in_short(estimated.build_s)} to "
        f"build, {in_short(estimated.mean_s)} a point ({len(estimated.point_s)} took {tried})"
    )
    return ExitStatus.SOLVED
