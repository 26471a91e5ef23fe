"""Paths of robot files: beside the problem, in ROS packages, among example robots."""

from __future__ import annotations

import contextlib
import importlib
import io
import os
import pkgutil
import sys
from collections.abc import Mapping, Sequence
from importlib import metadata
from pathlib import Path

from copose.errors import InputError, nearest, shown, together

EXAMPLES = "example-robot-data://"
PACKAGE = "package://"
DESCRIPTIONS = "robot_descriptions://"


class MissingPackageError(InputError):
    """An error about a package for which no folder was found."""


def resolve(
    urdf: str, folder: Path, packages: Mapping[str, Path], near: Sequence[Path] = ()
) -> Path:
    """The file that a URDF entry names.

    Args:
        urdf: ``example-robot-data://…``, ``robot_descriptions://NAME``, ``package://…``, or a path
            relative to ``folder``.
        folder: the problem file's.
        packages: folders of packages by name, looked into first.
        near: folders that may be the package, or hold it beside others, looked into next.

    Raises:
        InputError: the package or the file is not there; the message names the folders tried.
    """
    if urdf.startswith(EXAMPLES):
        return _example(urdf.removeprefix(EXAMPLES))
    if urdf.startswith(PACKAGE):
        return _package(urdf.removeprefix(PACKAGE), packages, near)
    if urdf.startswith(DESCRIPTIONS):
        return _description(urdf.removeprefix(DESCRIPTIONS))
    if "://" in urdf:
        kinds = f"{PACKAGE}…, {EXAMPLES}… or {DESCRIPTIONS}NAME"
        raise InputError(f"{urdf!r}: a file, {kinds} is expected")
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


def _description(name: str) -> Path:
    """The robot file of a module of the package robot_descriptions, which may fetch it."""
    try:
        import robot_descriptions
    except ImportError:
        raise InputError(
            "the package robot_descriptions is not installed; pip install robot_descriptions"
        ) from None
    names = [module.name for module in pkgutil.iter_modules(robot_descriptions.__path__)]
    if name not in names:
        raise InputError(f"robot_descriptions has no {shown(name)}{nearest(name, names)}")
    try:
        with contextlib.redirect_stderr(io.StringIO()):
            module = importlib.import_module(f"robot_descriptions.{name}")
    except Exception as error:
        # Fetching by git may fail in any way.
        raise InputError(f"robot_descriptions cannot fetch {name}: {error}") from None
    paths = (getattr(module, f"{kind}_PATH", None) for kind in ("URDF", "XACRO", "MJCF"))
    path = next(filter(None, paths), None)
    if path is None:
        raise InputError(f"robot_descriptions has no file of {name}")
    return Path(path)


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
    folders += package_folders(package)
    for folder in folders:
        if (folder / rest).is_file():
            return folder / rest
    known = [folder for folder in folders if folder.is_dir()]
    if known:
        raise InputError(f"package {package!r} has no file {rest!r} (looked in {_listed(known)})")
    raise MissingPackageError(
        f"package {package!r} was not found; name its folder by packages = {{ {package} = "
        f'"FOLDER" }} in [[arms]], by ROS_PACKAGE_PATH or by AMENT_PREFIX_PATH (tried '
        f"{_listed(folders) or 'neither, for they are not set'})"
    )


def _listed(folders: Sequence[Path]) -> str:
    """Folders in a message, as many as 100 characters hold."""
    return together(map(str, folders), ", ", 100)


def package_folders(package: str) -> list[Path]:
    """Folders in which a package may lie by ROS_PACKAGE_PATH and AMENT_PREFIX_PATH."""
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
