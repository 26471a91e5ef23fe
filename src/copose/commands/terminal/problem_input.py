"""The problem of a command, and places for its files, both checked before anything runs."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from copose.errors import InputError

if TYPE_CHECKING:
    from copose.problem import Problem


def prepare(arguments: argparse.Namespace, files: Sequence[str]) -> tuple[Path, Problem]:
    """The folder for files of these names and the problem, both known to be usable.

    Raises:
        InputError: the problem is wrong, or a file cannot be written.
    """
    from copose.report import check_format

    if arguments.figure is not None:
        check_format(arguments.figure)
        check_place(arguments.figure)
    problem = load_problem(arguments)
    folder = arguments.output if arguments.output is not None else Path(problem.name)
    for name in files:
        check_place(folder / name)
    return folder, problem


def load_problem(arguments: argparse.Namespace) -> Problem:
    """The problem of the command's file, with what its options set in place of the file's.

    Raises:
        InputError: as for `loader.load`.
    """
    from copose.loader import load
    from copose.problem import read_override

    changes: dict[str, object] = {}
    for key, value in map(read_override, arguments.set):
        # What is set again counts where it stands last.
        changes.pop(key, None)
        changes[key] = value
    return load(
        arguments.problem,
        set=changes,
        objective=getattr(arguments, "objective", None),
        direction=getattr(arguments, "direction", None),
    )


def check_place(file: Path) -> None:
    """Refuse a place that no file can be written to, before anything is.

    Raises:
        InputError: it is a folder, or its folder cannot be written to.
    """
    folder = file.parent
    try:
        if file.is_dir():
            raise InputError("is a folder; a file was expected", file=file)
        existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", file=file) from None
    if not existing.is_dir():
        raise InputError("is a file; a folder was expected", file=existing)
    if not os.access(existing, os.W_OK | os.X_OK):
        raise InputError("is a folder that you may not write to", file=existing)
