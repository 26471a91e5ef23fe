"""The command `copose path`: the best joint motion along an object path."""

from __future__ import annotations

import argparse
from collections.abc import Callable

from copose.commands.terminal.answer import (
    AnswerFile,
    print_answer,
    write_answer,
    write_interrupted,
)
from copose.commands.terminal.interrupts import on_interrupt
from copose.commands.terminal.output import watching
from copose.commands.terminal.parser import Command, CommandParser, add_outputs, add_search
from copose.commands.terminal.problem_input import prepare


class PathCommand(Command):
    """`copose path`: the best joint motion along an object path."""

    name = "path"
    summary = "the best joint motion along an object path"
    example = "problems/panda-carry-path.toml -o carried --ros --animate"
    reads_problem = True

    def add_arguments(self, parser: CommandParser) -> None:
        """See `Command.add_arguments`."""
        files = AnswerFile.RESULT, AnswerFile.TRAJECTORY, AnswerFile.PATH_PICTURE
        add_outputs(parser, files, "also draw a .png, .pdf or .svg")
        add_search(parser)
        parser.add_argument(
            "--ros", action="store_true",
            help=f"also write {AnswerFile.ROS}, a trajectory_msgs/JointTrajectory",
        )  # fmt: skip
        parser.add_argument("--animate", action="store_true", help=f"also draw {AnswerFile.FILM}")

    def run(self, arguments: argparse.Namespace) -> int:
        """See `Command.run`."""
        files = [AnswerFile.RESULT, *_files(arguments)]
        with watching(arguments) as watch:
            folder, problem = prepare(arguments, files)
            from copose.motion import plan

            with on_interrupt(watch.interrupt):
                motion = plan(problem, seed=arguments.seed, time_limit=arguments.time_limit)
            from copose.formats import joint_trajectory_yaml, trajectory_csv
            from copose.report import motion_animation, picture

            contents: dict[AnswerFile, Callable[[], bytes]] = {
                AnswerFile.TRAJECTORY: lambda: trajectory_csv(motion).encode(),
                AnswerFile.ROS: lambda: joint_trajectory_yaml(motion).encode(),
                AnswerFile.PATH_PICTURE: lambda: picture(motion, "png", arguments.style),
                AnswerFile.FILM: lambda: motion_animation(motion, arguments.style),
            }
            solved = motion.status == "solved"
            writers = {name: contents[name] for name in _files(arguments) if solved}
            if watch.interrupted:
                pictures = {AnswerFile.PATH_PICTURE, AnswerFile.FILM}
                texts = {name: write for name, write in writers.items() if name not in pictures}
                return write_interrupted(motion, folder, texts)
            figure = arguments.figure if solved else None
            write_answer(motion, folder, writers, figure, arguments.style)
        return print_answer(motion, folder, arguments)


def _files(arguments: argparse.Namespace) -> list[AnswerFile]:
    """The files beside the result, in the order in which they are written."""
    files = {
        AnswerFile.TRAJECTORY: True,
        AnswerFile.ROS: arguments.ros,
        AnswerFile.PATH_PICTURE: True,
        AnswerFile.FILM: arguments.animate,
    }
    return [name for name, asked in files.items() if asked]
