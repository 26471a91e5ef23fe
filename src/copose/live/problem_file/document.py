"""The problem on the page: the opened one with changes, its tables and its layout."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeAlias

from pydantic import BaseModel

from copose.loader import parse
from copose.poses import Pose
from copose.problem import Problem, held, overridden

Changes: TypeAlias = Mapping[str, Any]
"""Values by the dotted paths of ``--set``."""


@dataclass(frozen=True)
class Document:
    """A problem as it was opened."""

    whole: Problem  # the problem as it was read
    case: str = ""  # the case that is shown, of several; empty where the file has none
    # Number of the study's point whose problem it is; None without a study.
    point: int | None = None

    @classmethod
    def of(cls, problem: Problem) -> Document:
        """The document of a problem; of several cases the first is shown."""
        return cls(problem, next(iter(case_names(problem)), ""))

    def of_case(self, case: str) -> Document:
        """The same with another case shown."""
        return replace(self, case=case)

    def problem(self, changes: Changes) -> Problem:
        """The problem with changes, as it would be saved: of several cases the one that is shown,
        and with nothing free but joints.

        Raises:
            InputError: changes that no problem has.
        """
        return parse(overridden(self._tables, changes), self.whole.source)

    @cached_property
    def _tables(self) -> Mapping[str, Any]:
        """The tables of the case that is shown."""
        return tables_of(held(self.whole, self.case))


def case_names(problem: Problem) -> tuple[str, ...]:
    """The cases of a problem."""
    return tuple(case.name for case in problem.cases)


def place(pose: Pose, *, planar: bool) -> dict[str, Any]:
    """A pose as a problem file has it: position, m, and rpy or angle, rad."""
    if planar:
        return {"position": pose.position[:2].tolist(), "angle": float(pose.rpy[2])}
    return {"position": pose.position.tolist(), "rpy": pose.rpy.tolist()}


def key(*parts: str) -> str:
    """A dotted path of names, in quotes where they need them."""
    return ".".join(part if part.isidentifier() else json.dumps(part) for part in parts)


def same_layout(one: Problem, other: Problem) -> bool:
    """True where a page of one problem shows the other one as well."""
    return one is other or _layout(one) == _layout(other)


def _layout(problem: Problem) -> dict[str, Any]:
    """Shapes, robots, axes, numbers of waypoints, names of cases."""
    robot = ("name", "urdf", "mjcf", "xacro_args", "packages", "root", "tip", "locked", "links")
    return {
        "space": problem.space.name,
        "arms": [[getattr(arm, key, None) for key in robot] for arm in problem.arms],
        "shape": problem.object.shape,
        "obstacles": [(obstacle.name, obstacle.shape) for obstacle in problem.obstacles],
        "axes": problem.axes,
        "waypoints": 0 if problem.path is None else len(problem.path.waypoints),
        "cases": [case.name for case in problem.cases],
    }


def tables_of(problem: Problem) -> dict[str, Any]:
    """The tables of a problem, without values that are the default.

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
