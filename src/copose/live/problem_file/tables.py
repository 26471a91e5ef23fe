"""A problem's tables as a file has them: from the problem itself, or as another differs from it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from copose.problem import Problem

# Keys of a table that are written even where they are what leaving them out means.
_ALWAYS = ("kind",)
# Keys that a file may have in the place of others.
_WRITTEN = {"rpy": "quaternion"}


def tables_of(problem: Problem) -> dict[str, Any]:
    """All that a problem says, without what leaving it out means.

    `copose.parse` makes the same problem of it.
    """
    return _dumped(problem)


def grafted(tables: Mapping[str, Any], old: BaseModel, new: BaseModel) -> dict[str, Any]:
    """A file's tables with what another problem has instead; what equals stays as written.

    Args:
        tables: the file's, or a table of it.
        old: what was read from them.
        new: what is to be read from the result.
    """
    found = dict(tables)
    whole = _dumped(new)
    if type(old) is not type(new):
        return whole
    for key in type(new).model_fields:
        before, after = getattr(old, key), getattr(new, key)
        if before == after:
            continue
        # What was written in its place has been read as this.
        found.pop(_WRITTEN.get(key, ""), None)
        if key not in whole:
            found.pop(key, None)
        else:
            found[key] = _grafted_value(found.get(key), before, after, whole[key])
    return found


def _grafted_value(written: Any, before: Any, after: Any, whole: Any) -> Any:
    if isinstance(before, BaseModel) and isinstance(after, BaseModel):
        return grafted(written, before, after) if isinstance(written, Mapping) else whole
    tables = isinstance(written, list) and isinstance(before, tuple) and isinstance(after, tuple)
    if not tables or not len(written) == len(before) == len(after):
        return whole
    return [_grafted_value(*four) for four in zip(written, before, after, whole, strict=True)]


def _dumped(model: BaseModel) -> dict[str, Any]:
    found = {}
    for key, field in type(model).model_fields.items():
        value = getattr(model, key)
        if value is None:
            continue
        if key not in _ALWAYS and value == field.get_default(call_default_factory=True):
            continue
        found[key] = _value(value)
    return found


def _value(value: Any) -> Any:
    if isinstance(value, BaseModel):
        return _dumped(value)
    if isinstance(value, (list, tuple)):
        return [_value(entry) for entry in value]
    if isinstance(value, Mapping):
        return {key: _value(entry) for key, entry in value.items()}
    return value
