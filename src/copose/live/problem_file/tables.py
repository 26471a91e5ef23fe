"""The tables of a problem as its file has them, or as another file would have them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from copose.problem import Problem


def tables_of(problem: Problem) -> dict[str, Any]:
    """All values of a problem but those that are the default.

    `copose.parse` makes the same problem of them.
    """
    return _dumped(problem)


def grafted(tables: Mapping[str, Any], old: BaseModel, new: BaseModel) -> dict[str, Any]:
    """A file's tables with the values of another problem; values that are equal stay as written.

    Args:
        tables: the file's tables, or one of them.
        old: the model that was read from them.
        new: the model that is to be read from the result.
    """
    merged = dict(tables)
    whole = _dumped(new)
    if type(old) is not type(new):
        return whole
    for key in type(new).model_fields:
        before, after = getattr(old, key), getattr(new, key)
        if before == after:
            continue
        if key == "rpy":
            # A file may have a quaternion in its place.
            merged.pop("quaternion", None)
        if key not in whole:
            merged.pop(key, None)
        else:
            merged[key] = _grafted_value(merged.get(key), before, after, whole[key])
    return merged


def _grafted_value(written: Any, before: Any, after: Any, whole: Any) -> Any:
    """A value as it was written where it is equal, else the new one."""
    if isinstance(before, BaseModel) and isinstance(after, BaseModel):
        return grafted(written, before, after) if isinstance(written, Mapping) else whole
    tables = isinstance(written, list) and isinstance(before, tuple) and isinstance(after, tuple)
    if not tables or not len(written) == len(before) == len(after):
        return whole
    return [_grafted_value(*four) for four in zip(written, before, after, whole, strict=True)]


def _dumped(model: BaseModel) -> dict[str, Any]:
    """The values of a model but those that are the default; its kind always."""
    dumped = {}
    for key, field in type(model).model_fields.items():
        value = getattr(model, key)
        if value is None:
            continue
        if key != "kind" and value == field.get_default(call_default_factory=True):
            continue
        dumped[key] = _value(value)
    return dumped


def _value(value: Any) -> Any:
    """A value of the types that a TOML reader makes."""
    if isinstance(value, BaseModel):
        return _dumped(value)
    if isinstance(value, (list, tuple)):
        return [_value(entry) for entry in value]
    if isinstance(value, Mapping):
        return {key: _value(entry) for key, entry in value.items()}
    return value
