"""Where a ``urdf = …`` entry points: files beside the problem, ROS packages, example robots."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from importlib import metadata
from pathlib import Path

from copose.errors import InputError, nearest, together

EXAMPLES = "example-robot-data://"
PACKAGE = "package://"
# Characters of the folders that a message names.
_LISTED = 100


class MissingPackageError(InputError):
    """A package that no folder was found for."""


def resolve(
    urdf: str, folder: Path, packages: Mapping[str, Path], near: Sequence[Path] = ()
) -> Path:
    """The file that a URDF entry names.

    Args:
        urdf: ``example-robot-data://…``, ``package://…``, or a path relative to ``folder``.
        folder: the problem file's.
        packages: folders of packages by name, looked into first.
        near: folders that may be the package, or hold it beside others, looked into next.

    Raises:
        InputError: the package or the file is not there; the message says where was looked.
    """
    if urdf.startswith(EXAMPLES):
        return _example(urdf.removeprefix(EXAMPLES))
    if urdf.startswith(PACKAGE):
        return _package(urdf.removeprefix(PACKAGE), packages, near)
    if "://" in urdf:
        raise InputError(f"{urdf!r}: a file, {PACKAGE}… or {EXAMPLES}… is expected")
    return folder / Path(urdf).expanduser()


def _example(name: str) -> Path:
    for root in _example_roots():
        path = root / name
        if path.is_file():
            return path
        if root.is_dir():
            package, _, rest = name.partition("/")
            if not (root / package).is_dir():
                hint = nearest(package, [entry.name for entry in root.iterdir() if entry.is_dir()])
                raise InputError(f"example-robot-data has no folder {package!r}{hint}")
            files = [str(p.relative_to(root / package)) for p in (root / package).rglob("*.urdf")]
            raise InputError(
                f"example-robot-data's {package} has no {rest!r}{nearest(rest, files)}"
            )
    raise InputError(
        "the package example-robot-data is not installed; "
        "pip install 'copose[robots]' or pip install example-robot-data"
    )


def _example_roots() -> list[Path]:
    inside = Path("share/example-robot-data/robots")
    roots = [Path(sys.prefix) / inside]
    try:
        package = metadata.distribution("example-robot-data")
        roots.insert(0, Path(str(package.locate_file("cmeel.prefix"))) / inside)
    except metadata.PackageNotFoundError:
        pass
    return roots


def _package(name: str, packages: Mapping[str, Path], near: Sequence[Path]) -> Path:
    package, _, rest = name.partition("/")
    folders = [packages[package]] if package in packages else []
    folders += [folder for folder in near if folder.name == package]
    folders += [folder / package for folder in near]
    folders += _package_folders(package)
    for folder in folders:
        if (folder / rest).is_file():
            return folder / rest
    there = [folder for folder in folders if folder.is_dir()]
    if there:
        raise InputError(f"package {package!r} has no file {rest!r} (looked in {_listed(there)})")
    raise MissingPackageError(
        f"package {package!r} was not found; name its folder by packages = {{ {package} = "
        f'"FOLDER" }} in [[arms]], by ROS_PACKAGE_PATH or by AMENT_PREFIX_PATH (tried '
        f"{_listed(folders) or 'neither, for they are not set'})"
    )


def _listed(folders: Sequence[Path]) -> str:
    return together(map(str, folders), ", ", _LISTED)


def _package_folders(package: str) -> list[Path]:
    folders = []
    for entry in _search_path("ROS_PACKAGE_PATH"):
        if entry.name == package:
            folders.append(entry)
        folders.append(entry / package)
        # A ROS 1 workspace keeps packages in one folder of repositories.
        folders += sorted(entry.glob(f"*/{package}")) if entry.is_dir() else []
    folders += [entry / "share" / package for entry in _search_path("AMENT_PREFIX_PATH")]
    return folders


def _search_path(variable: str) -> list[Path]:
    return [Path(entry) for entry in os.environ.get(variable, "").split(os.pathsep) if entry]
