"""Reading of problem files: TOML to a problem, or to one line that says what is wrong with it."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from copose.errors import InputError
from copose.poses import Pose
from copose.problem.fields import as_tuples
from copose.problem.file.messages import explain
from copose.problem.objects import Placement, PlanarPlacement
from copose.problem.spaces import SPACES
from copose.problem.spec import PlanarProblem, Problem, SpatialProblem
from copose.problem.variants import changed


def read_bytes(path: Path, most_bytes: int = 1_000_000) -> bytes:
    """The bytes of a file.

    Raises:
        InputError: it cannot be read, or is longer than ``most_bytes``.
    """
    try:
        if path.is_dir():
            raise InputError("is a folder; a file was expected", file=path)
        if not path.is_file():
            raise InputError("no such file", file=path)
        size = path.stat().st_size
        if size > most_bytes:
            raise InputError(f"is {size} bytes long; at most {most_bytes} are read", file=path)
        return path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot be read: {reason}", file=path) from None


def read_text(path: Path, most_bytes: int = 1_000_000) -> str:
    """The text of a file in UTF-8, without the byte order mark of some editors.

    Raises:
        InputError: it cannot be read, or is no such text.
    """
    try:
        return read_bytes(path, most_bytes).decode("utf-8").removeprefix("\ufeff")
    except UnicodeDecodeError as error:
        raise InputError(f"is not UTF-8 text (byte {error.start})", file=path) from None


def read_tables(file: Path) -> dict[str, Any]:
    """The tables of a TOML file.

    Raises:
        InputError: it cannot be read, or is not TOML.
    """
    return tables_in(read_text(file), file)


def tables_in(text: str, file: Path | None = None) -> dict[str, Any]:
    """The tables of a TOML text, which is a file's.

    Raises:
        InputError: it is not TOML.
    """
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InputError("is nested too deeply", file=file) from None
    except ValueError as error:
        raise InputError(f"is not TOML: {error}", file=file) from None


def parse(data: Mapping[str, Any], source: Path | None = None) -> Problem:
    """A problem from tables in which every grasp is written out.

    Args:
        data: what a TOML reader makes of a problem file.
        source: the file it came from; relative paths in it start there.

    Raises:
        InputError: it breaks a rule of the format; the message names the first fault and how many
            more there are.
    """
    check_depth(data, source)
    model = PlanarProblem if is_planar(data) else SpatialProblem
    try:
        problem = model.model_validate(as_tuples(data))
    except ValidationError as error:
        raise explain(error, model, source, data) from None
    problem._source = source
    return problem


def is_planar(data: Mapping[str, Any]) -> bool:
    """True where tables are of a problem in the plane."""
    task = data.get("task")
    name = task.get("space") if isinstance(task, Mapping) else None
    return isinstance(name, str) and name in SPACES and SPACES[name].planar


def is_study(data: Mapping[str, Any]) -> bool:
    """True of the tables of a study file, False of a problem's."""
    return "vary" in data and "arms" not in data


def moved(problem: Problem, place: Mapping[str, Any]) -> Problem:
    """A problem with its object elsewhere.

    Args:
        problem: as read.
        place: ``position`` and ``rpy`` or ``quaternion``, in the plane ``angle``, as in
            ``[object]``; what it leaves out stays.

    Raises:
        InputError: it is no place.
    """
    if not isinstance(place, Mapping):
        raise InputError("a mapping as [object] has it is needed", key="object_pose")
    turn = "angle" if problem.space.planar else "rpy"
    allowed = ("position", turn) if problem.space.planar else ("position", turn, "quaternion")
    for key in place:
        if key not in allowed:
            raise InputError(
                f"is not known; allowed: {', '.join(allowed)}", key=f"object_pose.{key}"
            )
    held = problem.object
    model = PlanarPlacement if problem.space.planar else Placement
    stays = {key: getattr(held, key) for key in ("position", turn)}
    if "quaternion" in place:
        del stays[turn]
    try:
        # The object's other keys are as they were: only its place is checked again.
        new = model.model_validate({**stays, **as_tuples(place)})
    except ValidationError as error:
        fault = explain(error, model, None)
        raise InputError(fault.message, key=f"object_pose.{fault.key}") from None
    displaced = held.model_copy(update={key: getattr(new, key) for key in ("position", turn)})
    return changed(problem, {"object": displaced})


def placement(given: Mapping[str, Any], *, planar: bool) -> Pose:
    """A pose as a problem file has it.

    Args:
        given: ``position`` and ``rpy`` or ``quaternion``, in the plane ``angle``.
        planar: whether it is in the plane.

    Raises:
        InputError: it is no place.
    """
    model = PlanarPlacement if planar else Placement
    try:
        return model.model_validate(as_tuples(given)).pose
    except ValidationError as error:
        raise explain(error, model, None) from None


def check_depth(data: Mapping[str, Any], source: Path | None, deepest: int = 20) -> None:
    """Refuse tables that are nested more deeply than any problem is.

    Raises:
        InputError: they are.
    """
    level: list[object] = [data]
    for _ in range(deepest):
        level = [child for node in level for child in _children(node)]
        if not level:
            return
    raise InputError(f"is nested more than {deepest} levels deep", file=source)


def _children(node: object) -> Iterator[object]:
    if isinstance(node, Mapping):
        yield from node.values()
    elif isinstance(node, (list, tuple)):
        yield from node
