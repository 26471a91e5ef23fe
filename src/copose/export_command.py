"""The command `copose export`: its arguments and what it does."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

from copose.errors import InputError

TO = ("moveit", "srdf", "mujoco", "ros", "csv", "html")


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Give a parser the command's arguments."""
    command.add_argument("result", type=Path, metavar="RESULT.json", help="of solve or path")
    command.add_argument(
        "--to", choices=TO, required=True,
        help="RobotState, group_state, keyframe, JointState or JointTrajectory, a table, or a page",
    )  # fmt: skip
    command.add_argument(
        "--problem", type=Path, metavar="PROBLEM.toml",
        help="for mujoco and html, in place of the file that the result names",
    )  # fmt: skip
    command.add_argument("--case", metavar="NAME", help="whose posture (default: the first case's)")
    command.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="the file (default: beside the result)"
    )


def export_result(arguments: argparse.Namespace) -> tuple[Path, str]:
    """Write a result in another format.

    Returns:
        The file, and what is to be said of its names, if anything.

    Raises:
        InputError: it cannot be.
    """
    from copose.formats import exported_text, usual_name
    from copose.loader import load
    from copose.results import read_result, write_file

    source: Path = arguments.result
    result = read_result(source)
    problem = None if arguments.problem is None else load(arguments.problem)
    try:
        text = exported_text(result, arguments.to, problem=problem, case=arguments.case)
    except InputError as error:
        if error.file is None:
            raise InputError(error.message, key=error.key, file=source) from None
        raise
    file: Path = arguments.output
    if file is None:
        file = source.parent / usual_name(result, arguments.to)
    if any(file.resolve() == one.resolve() for one in (source, arguments.problem) if one):
        raise InputError("is read; the export needs a file of its own", file=file)
    write_file(file, text.encode())
    return file, "" if arguments.to in ("csv", "mujoco", "html") else _shared_names(
        result.joint_names
    )


def _shared_names(names: Mapping[str, Sequence[str]]) -> str:
    """That joints are called otherwise than in their robot's file, if they are."""
    from copose.formats.names import unique_names

    new = [
        name
        for arm, found in unique_names(names).items()
        for name, old in zip(found, names[arm], strict=True)
        if name != old
    ]
    return f"arms share joint names: theirs are ARM_JOINT here, such as {new[0]}" if new else ""
