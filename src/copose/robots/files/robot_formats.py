"""The formats of robot files, by the key of ``[[arms]]`` that names such a file: one line each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeAlias

from copose.robots.files.mjcf_tree import read_mjcf
from copose.robots.files.tree import Tree
from copose.robots.files.urdf_tree import read_tree

# A file, folders of packages by name, and arguments of xacro.
Reader: TypeAlias = Callable[[Path, Mapping[str, Path], Mapping[str, str]], Tree]

ROBOT_FORMATS: dict[str, Reader] = {
    "urdf": read_tree,
    "mjcf": lambda file, _packages, _arguments: read_mjcf(file),
}
