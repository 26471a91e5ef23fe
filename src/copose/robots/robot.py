"""Robots as their files are read, each file once, and on their bases."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np

from copose.errors import InputError, shown
from copose.poses import Pose
from copose.problem import RobotArm
from copose.robots.files.file_paths import resolve
from copose.robots.files.mjcf_tree import read_mjcf
from copose.robots.files.tree import Tree
from copose.robots.files.urdf_tree import read_tree
from copose.robots.files.xacro_file import XACRO

# A file, folders of packages by name, and arguments of xacro.
Reader: TypeAlias = Callable[[Path, Mapping[str, Path], Mapping[str, str]], Tree]

ROBOT_FORMATS: dict[str, Reader] = {
    "urdf": read_tree,
    "mjcf": lambda file, _packages, _arguments: read_mjcf(file),
}


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot's file, read, and the folders of the packages that it may name."""

    tree: Tree
    packages: Mapping[str, Path]


RobotsRead: TypeAlias = dict[object, Robot]


def read_robot(spec: RobotArm, folder: Path, key: str, read: RobotsRead) -> Robot:
    """The robot of an arm's file, read once per file and folders of packages; relative paths start
    in the problem file's folder.

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


@dataclass(frozen=True, eq=False)
class RobotOnBase:
    """The robot that an arm is part of, on its base."""

    source: object  # its file, with the arguments of xacro
    origin: Pose  # T_world_universe of the whole robot
    # The movable joints above the tip, from its root link: the position of a locked one, rad or m,
    # and None where the arm moves it.
    hangs_on: Mapping[str, float | None]

    def same(self, other: RobotOnBase) -> bool:
        """True for two arms that are parts of one robot: one file at one base."""
        return self.source == other.source and coincide(self.origin, other.origin)

    def clash(self, other: RobotOnBase) -> str | None:
        """The reason why the two arms do not move independently; None where they do."""
        if not self.same(other):
            return None
        common = {
            joint: (position, other.hangs_on[joint])
            for joint, position in self.hangs_on.items()
            if joint in other.hangs_on
        }
        moved = [joint for joint, both in common.items() if None in both]
        if moved:
            at = {
                joint: next((position for position in both if position is not None), 0.0)
                for joint, both in common.items()
                if both[0] is None or both[0] != both[1]
            }
            locked = ", ".join(f"{_toml_key(joint)} = {position}" for joint, position in at.items())
            return (
                f"both hang on {', '.join(moved)}, and so are not independent; lock in both, where "
                f"you want: locked = {{ {locked} }}"
            )
        for joint, (position, other_position) in common.items():
            if position != other_position:
                return (
                    f"hold joint {joint!r} at different positions, {position:g} and "
                    f"{other_position:g}; lock it at one"
                )
        return None


def coincide(one: Pose, other: Pose) -> bool:
    """True for poses that are equal to 1e-9, in m and in the entries of rotations."""
    first, second = (np.column_stack([pose.rotation, pose.position]) for pose in (one, other))
    return np.allclose(first, second, rtol=0, atol=1e-9)


def _toml_key(name: str) -> str:
    return name if re.fullmatch(r"[\w-]+", name, re.ASCII) else json.dumps(name, ensure_ascii=False)
