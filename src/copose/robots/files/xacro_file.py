"""Expansion of .xacro files to URDF by the package xacro, without ROS."""

from __future__ import annotations

import contextlib
import io
import threading
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from copose.errors import InputError
from copose.robots.files.file_paths import package_folders

XACRO = ".xacro"
# xacro keeps its state in its module.
_LOCK = threading.Lock()


def expanded(file: Path, arguments: Mapping[str, str], packages: Mapping[str, Path]) -> str:
    """The URDF that xacro makes of a file.

    Args:
        file: a .xacro.
        arguments: by name.
        packages: folders of packages by name, where ``$(find …)`` looks first; then on
            ROS_PACKAGE_PATH and AMENT_PREFIX_PATH, and for a package.xml above the file.

    Raises:
        InputError: xacro is not installed, or refuses the file.
    """
    try:
        import xacro
    except ImportError:
        raise InputError(
            f"{file.name} is xacro, which is not installed; pip install 'copose[xacro]', or run: "
            f"xacro {file.name} > {file.name.split('.')[0]}_expanded.urdf, and name that"
        ) from None
    told = io.StringIO()
    with _LOCK, _finding(file, packages), contextlib.redirect_stderr(told):
        try:
            document = xacro.process_file(str(file), mappings=dict(arguments))
            return str(document.toxml())
        except InputError:
            raise
        except Exception as error:
            # The expressions in the file may raise anything.
            cause = getattr(error, "exc", None)
            if isinstance(cause, InputError):
                raise cause from None
            raise InputError(f"{file.name}: xacro says: {str(error) or repr(error)}") from None


def unexpanded(file: Path) -> str:
    """A message that a file has to be run by xacro, and how."""
    return (
        f"{file.name} is xacro, not URDF; run: xacro {file.name} > "
        f"{file.name.split('.')[0]}_expanded.urdf, and name that"
    )


@contextlib.contextmanager
def _finding(file: Path, packages: Mapping[str, Path]) -> Iterator[None]:
    """A time in which xacro has a ``find`` that needs no ROS."""
    from xacro import substitution_args

    def find(package: str) -> str:
        return str(_package(package, file, packages))

    known: dict[str, Any] = substitution_args._eval_dict
    its_own = substitution_args._eval_find
    substitution_args._eval_find = known["find"] = find
    try:
        yield
    finally:
        substitution_args._eval_find = known["find"] = its_own


def _package(name: str, file: Path, packages: Mapping[str, Path]) -> Path:
    if name in packages:
        return packages[name]
    for folder in package_folders(name):
        if folder.is_dir():
            return folder
    for above in file.parents:
        for folder in (above, above / name):
            if _called(folder) == name:
                return folder
    raise InputError(
        f"{file.name} needs package {name!r}, which was not found; name its folder by packages = "
        f'{{ {name} = "FOLDER" }} in [[arms]], or by ROS_PACKAGE_PATH'
    )


def _called(folder: Path) -> str | None:
    """The name of the package in a folder; None where there is none."""
    try:
        return (ET.parse(folder / "package.xml").getroot().findtext("name") or "").strip()
    except (OSError, ET.ParseError):
        return None
