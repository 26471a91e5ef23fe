"""The command `copose export`: a posture or a motion for another program."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

from copose.commands.terminal.output import print_line, print_place, watching
from copose.commands.terminal.parser import Command, CommandParser, add_verbosity
from copose.errors import InputError, blamed_on
from copose.interrupt import ExitStatus

# The formats, as in `formats.FORMATS`, which takes long to import.
TO = ("moveit", "srdf", "mujoco", "ros", "csv", "html")


class ExportCommand(Command):
    """`copose export`: a posture or a motion for another program."""

    name = "export"
    summary = "a posture or a motion for another program"
    example = "panda/result.json --to moveit -o panda.yaml"

    def add_arguments(self, parser: CommandParser) -> None:
        """See `Command.add_arguments`."""
        parser.add_argument("result", type=Path, metavar="RESULT.json", help="of solve or path")
        parser.add_argument(
            "--to", choices=TO, required=True,
            help="RobotState, group_state, keyframe, JointState or JointTrajectory, a table, or a "
            "page",
        )  # fmt: skip
        parser.add_argument(
            "--problem", type=Path, metavar="PROBLEM.toml",
            help="for mujoco and html, in place of the file that the result names",
        )  # fmt: skip
        parser.add_argument(
            "--case", metavar="NAME", help="whose posture (default: the first case's)"
        )
        parser.add_argument(
            "-o", "--output", type=Path, metavar="FILE",
            help="the file (default: beside the result)",
        )  # fmt: skip
        add_verbosity(parser)

    def run(self, arguments: argparse.Namespace) -> int:
        """See `Command.run`."""
        with watching(arguments):
            from copose.formats import exported_text, usual_name
            from copose.loader import load
            from copose.results import read_result, write_file

            source: Path = arguments.result
            result = read_result(source)
            problem = None if arguments.problem is None else load(arguments.problem)
            with blamed_on(source):
                text = exported_text(result, arguments.to, problem=problem, case=arguments.case)
            file: Path = arguments.output
            if file is None:
                file = source.parent / usual_name(result, arguments.to)
            if any(file.resolve() == one.resolve() for one in (source, arguments.problem) if one):
                raise InputError("is read; the export needs a file of its own", file=file)
            write_file(file, text.encode())
            robot_names = arguments.to in ("moveit", "srdf", "ros")
            renamed = _renamed_joints(result.joint_names) if robot_names else ""
        if not arguments.quiet:
            if renamed:
                print_line(renamed)
            print_place(file)
        return ExitStatus.SOLVED


def _renamed_joints(names: Mapping[str, Sequence[str]]) -> str:
    """A line on joints that are called otherwise than in their robot's file, if any are."""
    from copose.formats.postures import unique_names

    new = [
        unique
        for arm, unique_of_arm in unique_names(names).items()
        for unique, name in zip(unique_of_arm, names[arm], strict=True)
        if unique != name
    ]
    return f"arms share joint names: theirs are ARM_JOINT here, such as {new[0]}" if new else ""
