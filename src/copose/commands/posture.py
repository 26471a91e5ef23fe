"""The commands `copose solve` and `copose evaluate`: the best posture, and a given one."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from copose.commands.terminal.answer import (
    AnswerFile,
    print_answer,
    write_answer,
    write_interrupted,
)
from copose.commands.terminal.interrupts import on_interrupt
from copose.commands.terminal.output import watching
from copose.commands.terminal.parser import (
    Command,
    CommandParser,
    add_objective,
    add_outputs,
    add_search,
    positive,
)
from copose.commands.terminal.problem_input import prepare
from copose.errors import blamed_on

if TYPE_CHECKING:
    from copose.results import Solution


class SolveCommand(Command):
    """`copose solve`: the best posture of a problem."""

    name = "solve"
    summary = "find the best posture"
    example = "problems/two-panda-box.toml -o panda --set object.mass=3 --verify"
    reads_problem = True

    def add_arguments(self, parser: CommandParser) -> None:
        """See `Command.add_arguments`."""
        _add_posture_outputs(parser)
        add_search(parser)
        parser.add_argument(
            "--effort", choices=("low", "normal", "high"), default="normal",
            help="how much is searched (default: normal)",
        )  # fmt: skip
        parser.add_argument(
            "--verify", action="store_true",
            help="search again, another seed and twice the effort, and say whether the answer "
            "stands",
        )  # fmt: skip
        parser.add_argument(
            "--prove", type=positive, nargs="?", const=1e-6, metavar="EPS",
            help="prove that no posture beats the answer by more than EPS (default: 1e-6)",
        )  # fmt: skip

    def run(self, arguments: argparse.Namespace) -> int:
        """See `Command.run`."""
        with watching(arguments) as watch:
            folder, problem = prepare(arguments, _posture_files())
            from copose.posture import solve

            with on_interrupt(watch.interrupt):
                solution = solve(
                    problem,
                    seed=arguments.seed,
                    effort=arguments.effort,
                    verify=arguments.verify,
                    prove=arguments.prove,
                    time_limit=arguments.time_limit,
                )
            if watch.interrupted:
                return write_interrupted(solution, folder, {})
            _write_posture(solution, folder, arguments)
        return print_answer(solution, folder, arguments)


class EvaluateCommand(Command):
    """`copose evaluate`: the ellipsoids of the file's start, or of a result's posture."""

    name = "evaluate"
    summary = "the ellipsoids of the file's start"
    example = "problems/two-panda-box.toml --joints panda/result.json --figure panda.pdf"
    reads_problem = True

    def add_arguments(self, parser: CommandParser) -> None:
        """See `Command.add_arguments`."""
        _add_posture_outputs(parser)
        parser.add_argument(
            "--joints", type=Path, metavar="RESULT.json",
            help="measure this result's posture instead",
        )  # fmt: skip

    def run(self, arguments: argparse.Namespace) -> int:
        """See `Command.run`."""
        with watching(arguments):
            folder, problem = prepare(arguments, _posture_files())
            from copose.posture.evaluation import evaluate
            from copose.results import read_solution

            result = None if arguments.joints is None else read_solution(arguments.joints)
            with blamed_on(arguments.joints):
                solution = evaluate(problem, result)
            _write_posture(solution, folder, arguments)
        return print_answer(solution, folder, arguments)


def _posture_files() -> tuple[AnswerFile, AnswerFile]:
    return AnswerFile.RESULT, AnswerFile.PICTURE


def _add_posture_outputs(parser: CommandParser) -> None:
    figure = "also draw a .png, .pdf or .svg; of an infeasible problem, its nearest miss"
    add_outputs(parser, _posture_files(), figure)
    add_objective(parser)


def _write_posture(solution: Solution, folder: Path, arguments: argparse.Namespace) -> None:
    from copose.report import picture

    writers: dict[AnswerFile, Callable[[], bytes]] = {}
    if solution.status == "solved":
        writers[AnswerFile.PICTURE] = lambda: picture(solution, "png", arguments.style)
    write_answer(solution, folder, writers, arguments.figure, arguments.style)
