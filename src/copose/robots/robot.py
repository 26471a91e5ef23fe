"""Robots as their files are read, each file once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from copose.errors import InputError, shown
from copose.problem import RobotArm
from copose.robots.files.file_paths import resolve
from copose.robots.files.robot_formats import ROBOT_FORMATS
from copose.robots.files.tree import Tree
from copose.robots.files.xacro_file import XACRO


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot's file, read, and the folders of the packages that it may name."""

    tree: Tree
    packages: Mapping[str, Path]


RobotsRead: TypeAlias = dict[object, Robot]


def read_robot(spec: RobotArm, folder: Path, key: str, read: RobotsRead) -> Robot:
    """The robot of an arm's file, read once per file and folders of packages.

    Args:
        spec: the ``[[arms]]`` table.
        folder: the problem file's, where relative paths start.
        key: of the table, for messages.
        read: robots already read; grows.

    Raises:
        InputError: the file is missing or cannot be used.
    """
    packages = {
        name: _package_folder(place, folder, f"{key}.packages.{name}")
        for name, place in spec.packages.items()
    }
    try:
        file = resolve(spec.file, folder, packages).resolve()
        arguments = {name: _xacro_text(value) for name, value in spec.xacro_args.items()}
        if arguments and file.suffix != XACRO:
            raise InputError(f"xacro_args have no effect: {file.name} is no {XACRO}")
        kind = (
            spec.kind, file, tuple(sorted(packages.items())), tuple(sorted(arguments.items())),
        )  # fmt: skip
        if kind not in read:
            tree = ROBOT_FORMATS[spec.kind](file, packages, arguments)
            read[kind] = Robot(tree, packages)
        return read[kind]
    except InputError as error:
        text = f"{error.file}: {error.message}" if error.file else error.message
        raise InputError(text, key=f"{key}.{spec.kind}") from None
    except (OSError, ValueError, RuntimeError) as error:
        # Raised by pathlib for unknown users, zero bytes, endless names and circular links.
        text = f"{shown(spec.file)} is no usable path: {error}"
        raise InputError(text, key=f"{key}.{spec.kind}") from None


def _package_folder(place: str, folder: Path, key: str) -> Path:
    try:
        return (folder / Path(place).expanduser()).resolve()
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError(f"{shown(place)} is no usable path: {error}", key=key) from None


def _xacro_text(value: str | bool | int | float) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
