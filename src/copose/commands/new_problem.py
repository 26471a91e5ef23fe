"""The command `copose init`: a problem file made from robots."""

from __future__ import annotations

import argparse
from pathlib import Path

from copose.commands.terminal.output import print_place, print_rich, tell, watching
from copose.commands.terminal.parser import (
    Command,
    CommandParser,
    add_verbosity,
    edges,
    named_numbers,
    positive,
)
from copose.commands.terminal.problem_input import check_place
from copose.errors import InputError
from copose.interrupt import ExitStatus


class InitCommand(Command):
    """`copose init`: a problem file made from robots."""

    name = "init"
    summary = "make a problem file from robots; guesses have a comment"
    example = "example-robot-data://panda_description/urdf/panda.urdf --mass 2 -o cell.toml"

    def add_arguments(self, parser: CommandParser) -> None:
        """See `Command.add_arguments`."""
        parser.add_argument(
            "robots", nargs="+", metavar="ROBOT",
            help="a URDF or MuJoCo model with several arms, or several: a path, package://… or "
            "example-robot-data://…",
        )  # fmt: skip
        parser.add_argument(
            "-o", "--output", type=Path, metavar="FILE.toml",
            help="the problem file (default: the robots' names)",
        )  # fmt: skip
        parser.add_argument(
            "--tip", action="append", default=[], metavar="[NAME=]LINK",
            help="a link that grasps, and what its arm is called (repeatable)",
        )  # fmt: skip
        parser.add_argument(
            "--joints", action="append", default=[], type=named_numbers, metavar="ARM=Q1,Q2,…",
            help="joint positions, rad or m: the arms hold the object as they are (repeatable)",
        )  # fmt: skip
        parser.add_argument("--mass", type=positive, metavar="KG", help="of the object")
        parser.add_argument("--size", type=edges, metavar="X,Y,Z", help="of the box that it is, m")
        parser.add_argument(
            "--space", choices=("spatial", "spatial-linear"), help="rigid grasps, or ball joints"
        )
        parser.add_argument("--overwrite", action="store_true", help="replace a file that is there")
        add_verbosity(parser)

    def run(self, arguments: argparse.Namespace) -> int:
        """See `Command.run`."""
        with watching(arguments):
            from copose.setup import Wishes, default_name, draft

            file = arguments.output
            if file is None:
                file = Path(f"{default_name(arguments.robots)}.toml")
            check_place(file)
            if file.exists() and not arguments.overwrite:
                raise InputError("is there already; --overwrite replaces it", file=file)
            wishes = Wishes(
                tips=arguments.tip,
                joints=dict(arguments.joints),
                mass=arguments.mass,
                size=arguments.size,
                space=arguments.space,
            )
            made = draft(arguments.robots, file, wishes)
            from copose.results import write_file

            write_file(file, made.text.encode())
        if not arguments.quiet:
            from copose.report.text import guesses

            print_rich(guesses(made.guesses))
            print_place(file)
        missed = [start for start in made.starts if not start.closed]
        if missed:
            misses = (
                f"arm {start.arm.name!r} misses its grasp by {start.miss}" for start in missed
            )
            tell(f"no posture that closes was found: {'; '.join(misses)}")
            return ExitStatus.INFEASIBLE
        return ExitStatus.SOLVED
