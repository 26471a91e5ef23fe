"""The answer of a command: the files in its folder, its table, its exit status."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Callable, Iterator, Mapping
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from copose import interrupt
from copose.commands.terminal.interrupts import on_interrupt
from copose.commands.terminal.output import print_place, print_rich, printing, tell
from copose.errors import InputError
from copose.interrupt import ExitStatus
from copose.progress import sheltered, stage

if TYPE_CHECKING:
    from copose.report.figures.files import Style
    from copose.results import Motion, Solution


class AnswerFile(StrEnum):
    """The names of the files in the folder of an answer."""

    RESULT = "result.json"
    PICTURE = "before_after.png"
    TRAJECTORY = "trajectory.csv"
    ROS = "trajectory.yaml"
    PATH_PICTURE = "path.png"
    FILM = "path.gif"


Writers: TypeAlias = Mapping[AnswerFile, Callable[[], bytes]]
"""The contents of files, by their names, made when they are written."""


def write_answer(
    answer: Solution | Motion,
    folder: Path,
    writers: Writers,
    figure: Path | None = None,
    style: Style = "bodies",
) -> None:
    """Write a result, then what lies beside it in place of an earlier run's, and a figure anywhere.

    Raises:
        InputError: the result cannot be written; of other files a line warns.
    """
    from copose.report import draw
    from copose.results import to_json, write_file

    for name in AnswerFile:
        if name is not AnswerFile.RESULT:
            with spared(folder / name):
                (folder / name).unlink(missing_ok=True)
    result = folder / AnswerFile.RESULT
    write_file(result, to_json(answer).encode())
    if writers or figure is not None:
        stage("drawing")
    with on_interrupt(partial(interrupt.end, f": the answer is in {result}")):
        for file, content in writers.items():
            with spared(folder / file):
                write_file(folder / file, content())
        if figure is not None:
            with spared(figure):
                draw(answer, figure, style)


@contextlib.contextmanager
def spared(file: Path) -> Iterator[None]:
    """A file that an answer can do without: where it fails, a line says so."""
    try:
        yield
    except InputError as error:
        tell(f"warning: {error}")
    except Exception as error:
        # Whatever may go wrong in a drawing: fonts, settings, what Matplotlib itself lacks.
        tell(f"warning: {file}: {type(error).__name__}: {error}")


def print_answer(answer: Solution | Motion, folder: Path, arguments: argparse.Namespace) -> int:
    """Print an answer, and return its exit status."""
    from copose.results import Solution, to_json

    if arguments.json:
        with printing():
            sys.stdout.write(to_json(answer))
    elif not arguments.quiet:
        from copose.report.text import motion_table, solution_table

        verbose: bool = arguments.verbose
        if isinstance(answer, Solution):
            print_rich(solution_table(answer, verbose=verbose))
        else:
            print_rich(motion_table(answer, verbose=verbose))
        print_place(folder)
    if answer.reason is not None:
        tell(f"{answer.status}: {answer.reason}")
    return ExitStatus[answer.status.upper()]


def write_interrupted(answer: Solution | Motion, folder: Path, writers: Writers) -> int:
    """Write what an interrupted command has found, without pictures, which take a second or two,
    and say so.
    """
    written = ""
    if answer.status == "solved":
        with sheltered():
            write_answer(answer, folder, writers)
        written = f": the best so far is in {folder / AnswerFile.RESULT}"
    tell(f"interrupted{written}")
    return ExitStatus.INTERRUPTED
