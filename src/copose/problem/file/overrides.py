"""Overrides of single keys of a problem's tables, such as ``object.mass = 3``."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from copose.errors import InputError, nearest, shown
from copose.problem.file.messages import tables_of
from copose.problem.file.reading import is_planar
from copose.problem.objects import Placement
from copose.problem.spec import PlanarProblem, SpatialProblem


def read_override(text: str) -> tuple[str, Any]:
    """Key and value of ``KEY=VALUE``: the value is TOML, else taken as a string.

    Raises:
        InputError: it is no such thing.
    """
    try:
        end = _parts(text)[1]
    except InputError:
        end = 0
    if not text[end - 1 : end] == "=":
        raise InputError(f"{shown(text)} is not KEY=VALUE, such as object.mass=3", key="--set")
    key, value = text[: end - 1], text[end:]
    try:
        tables = tomllib.loads(f"value = {value}")
    except (ValueError, RecursionError):
        tables = {}
    return key, tables["value"] if list(tables) == ["value"] else value


def aimed(
    data: Mapping[str, Any], kind: str | None = None, direction: Sequence[float] | None = None
) -> dict[str, Any]:
    """A problem's tables with another objective, of the file's only ``axes`` are kept; a direction
    alone is of task compatibility.

    In the space ``spatial`` three numbers are linear, unless ``axes`` are three.
    """
    kind = "task-compatibility" if kind is None and direction is not None else kind
    changed, old = dict(data), data.get("objective")
    if kind is not None:
        if isinstance(old, Mapping):
            changed["objective"] = {key: old[key] for key in ("kind", "axes") if key in old}
        changed = overridden(changed, {"objective.kind": kind})
    if direction is None:
        return changed
    along, task = [float(x) for x in direction], changed.get("task")
    axes = changed["objective"].get("axes")
    if len(along) == 3 and isinstance(task, Mapping) and task.get("space") == "spatial":
        three = isinstance(axes, list) and len(axes) == 3
        along += [] if three else [0.0] * 3
    several = kind in ("task-compatibility", "acceleration")
    change = {"directions": [{"direction": along}]} if several else {"direction": along}
    return overridden(changed, {f"objective.{key}": value for key, value in change.items()})


def overridden(data: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """A problem's tables with keys replaced, or added, one after the other.

    Args:
        data: the tables; they stay as they are.
        changes: values by dotted path. Arms, obstacles and cases go by name, in quotes where it
            has dots; components of arrays by x, y, z or a number from 0. Of a table that changes
            its ``kind`` only keys stay that the new kind has.

    Raises:
        InputError: a path that leads nowhere; the tables themselves are not judged.
    """
    model = PlanarProblem if is_planar(data) else SpatialProblem
    result: Any = _copied(data)
    for key, value in changes.items():
        parts, end = _parts(key)
        if end < len(key):
            raise InputError("is no path of keys", key=key)
        _put(result, parts, _copied(value), [model], key)
    return dict(result)


def _parts(text: str) -> tuple[list[str], int]:
    """The keys of a dotted path, and where what follows its equals sign begins.

    Raises:
        InputError: it is no path of at most 20 keys.
    """
    key = re.compile(r"""\s*("(?:[^"\\]|\\.)*"|'[^']*'|[^.="'][^.=]*)\s*([.=]|$)""")
    parts: list[str] = []
    end = 0
    while True:
        match = key.match(text, end)
        if match is None or len(parts) == 20:
            raise InputError("is no path of keys such as object.mass", key=text)
        word, after = match[1].strip(), match[2]
        if word[0] in "\"'":
            try:
                word = tomllib.loads(f"word = {word}")["word"]
            except ValueError:
                raise InputError("is no path of keys such as object.mass", key=text) from None
        parts.append(word)
        end = match.end()
        if after != ".":
            return parts, end


def _put(
    node: Any, parts: Sequence[str], value: Any, models: Sequence[type[BaseModel]], key: str
) -> None:
    """Set what lies at the end of a path below a table, or an array of tables, of these models."""
    part, *rest = parts
    if isinstance(node, list):
        index = _index(node, part, key)
        if rest:
            _put(node[index], rest, value, models, key)
        else:
            node[index] = value
        return
    if not isinstance(node, dict):
        raise InputError(f"there is no {shown(part)} in {shown(node)}", key=key)
    fields = [model.model_fields[part] for model in models if part in model.model_fields]
    if rest:
        inner = [table for field in fields for table in tables_of(field.annotation)]
        if part not in node:
            node[part] = _beginning(node, part, fields, bool(inner), key)
        _put(node[part], rest, value, inner, key)
    else:
        node[part] = value
        if part == "kind":
            _keep_legal(node, models)
    # Two ways to say one thing: either takes the other's place.
    for pair in (("rpy", "quaternion"), ("direction", "directions")):
        if part in pair:
            node.pop(pair[1 - pair.index(part)], None)


def _index(node: Sequence[Any], part: str, key: str) -> int:
    names = [entry["name"] for entry in node if isinstance(entry, dict) and "name" in entry]
    if names:
        if part not in names:
            hint = nearest(part, [name for name in names if isinstance(name, str)])
            raise InputError(f"none is called {shown(part)}{hint}", key=key)
        return next(i for i, e in enumerate(node) if isinstance(e, dict) and e.get("name") == part)
    index = "xyz".find(part) if len(part) == 1 and part in "xyz" else -1
    if part.isascii() and part.isdigit():
        index = int(part[:9])
    if not 0 <= index < len(node):
        raise InputError(
            f"no component {shown(part)} in {len(node)}; x, y, z or a number from 0 names one",
            key=key,
        )
    return index


def _beginning(
    node: Mapping[str, Any], part: str, fields: Sequence[FieldInfo], table: bool, key: str
) -> Any:
    """Value of an absent key before a part of it is set: the default that leaving it out means."""
    if part == "rpy" and "quaternion" in node:
        try:
            meant = Placement.model_validate({"quaternion": tuple(node["quaternion"])})
        except (TypeError, ValidationError):
            raise InputError("quaternion beside it is none; set the whole of it", key=key) from None
        return list(meant.rpy)
    default = fields[0].get_default(call_default_factory=True) if fields else {}
    if isinstance(default, tuple):
        return list(default)
    if table or isinstance(default, Mapping):
        return {}
    raise InputError(f"{part} is not there to change a part of; set the whole of it", key=key)


def _keep_legal(node: dict[str, Any], models: Sequence[type[BaseModel]]) -> None:
    """Drop what a table's new kind does not have."""
    for model in models:
        kind = model.model_fields.get("kind")
        if kind is not None and node["kind"] in get_args(kind.annotation):
            for name in [name for name in node if name not in model.model_fields]:
                del node[name]
            return


def _copied(node: Any) -> Any:
    """Tables and arrays that may be changed."""
    if isinstance(node, Mapping):
        return {key: _copied(value) for key, value in node.items()}
    return [_copied(value) for value in node] if isinstance(node, (list, tuple)) else node
