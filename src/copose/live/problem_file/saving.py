"""Saving a changed problem as a problem file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from copose.errors import InputError
from copose.live.problem_file.document import grafted, tables_of
from copose.live.problem_file.toml_text import text_of, text_with
from copose.loader import parse, taught
from copose.problem import Problem, read_text, tables_in
from copose.results import write_file


def problem_text(problem: Problem) -> str:
    """A problem as TOML: the text of its file with the values that differ, or without a file all.

    Raises:
        InputError: tomlkit is missing.
    """
    if problem.source is None:
        return text_of(tables_of(problem))
    try:
        text = read_text(problem.source)
        tables = tables_in(text, problem.source)
        read = parse(tables, problem.source)
    except InputError:
        # The file is gone, or is another one by now.
        return text_of(tables_of(problem))
    for start in (tables, taught(tables, problem.source)):
        tables = grafted(start, read, problem)
        if _parsed(tables, problem.source) == problem:
            return text_with(text, tables)
    return text_of(tables_of(problem))


def save_problem(problem: Problem, target: Path, *, overwrite: bool = False) -> Problem:
    """Write a problem as a file: its source with the values that differ, or without one all; a file
    that is there, the source too, is replaced on request only.

    Relative paths of robots and packages are written anew where the folder is another.

    Returns:
        The problem that the file holds.

    Raises:
        InputError: the problem is wrong, a file is there already, it cannot be written, or tomlkit
            is missing; nothing is written.
    """
    _check_place(target, overwrite)
    text = problem_text(problem)
    old = problem.source.parent if problem.source is not None else Path()
    tables = _with_paths_from(tables_in(text), old, target.parent)
    saved = parse(tables, target)
    write_file(target, text_with(text, tables).encode())
    return saved


def _parsed(tables: Mapping[str, Any], source: Path | None) -> Problem | None:
    """The problem of some tables; None where it is wrong."""
    try:
        return parse(tables, source)
    except InputError:
        return None


def _check_place(target: Path, overwrite: bool) -> None:
    """Refuse a folder, and a file that is there unless it may be overwritten."""
    try:
        if target.is_dir():
            raise InputError("is a folder; a file was expected", file=target)
        taken = target.exists()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot be written: {reason}", file=target) from None
    if taken and not overwrite:
        raise InputError("is there already; give another name, or overwrite it", file=target)


def _with_paths_from(tables: dict[str, Any], old: Path, new: Path) -> dict[str, Any]:
    """The same tables, with relative paths from another folder."""
    if old.resolve() == new.resolve() or not isinstance(tables.get("arms"), list):
        return tables
    arms = []
    for arm in tables["arms"]:
        if not isinstance(arm, dict):
            return tables
        paths = {key: _path_from(arm[key], old, new) for key in ("urdf", "mjcf") if key in arm}
        if isinstance(arm.get("packages"), dict):
            named = arm["packages"].items()
            paths["packages"] = {name: _path_from(path, old, new) for name, path in named}
        arms.append({**arm, **paths})
    return {**tables, "arms": arms}


def _path_from(place: Any, old: Path, new: Path) -> Any:
    """A path, relative to a folder, relative to another one; absolute on another drive."""
    if not isinstance(place, str) or "://" in place:
        return place
    try:
        if Path(place).expanduser().is_absolute():
            return place
        whole = old / place
        # Links on the way are followed: the way back goes by real folders.
        real = whole.parent.resolve() / whole.name
    except (OSError, RuntimeError, ValueError):
        # No path at all, which reading the robot will say.
        return place
    try:
        return Path(os.path.relpath(real, new.resolve())).as_posix()
    except ValueError:
        return real.as_posix()
