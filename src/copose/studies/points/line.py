"""The line of a point: what of a result a study keeps."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel

from copose.errors import InputError, nearest
from copose.problem import Problem
from copose.results import Motion, Posture, Solution
from copose.studies.points.hashes import RECORD_FORMAT
from copose.studies.points.points import Point


@dataclass(frozen=True)
class PointLine:
    """The line of a point in the record of a study.

    Attributes:
        point: whose it is.
        status: of its result.
        reason: why there is no posture; None where there is one.
        objective: the value after; None where there is none.
        joints: rad or m, by arm, of cases by case and arm; None where there are none.
        placement: where the object, bases and grasps are that may be moved, as values of keys, of
            cases by case; None where nothing may or nothing is found.
        record: numbers of the result, by dotted path, None where they do not exist; empty where
            there is no result.
        missing: arms that miss their grasp.
        seconds: that the point took.
        stopped: whether a time limit or a crash ended it, so that another try may end otherwise.
    """

    point: Point
    status: str
    reason: str | None
    objective: float | None = None
    joints: Mapping[str, Any] | None = None
    placement: Mapping[str, Any] | None = None
    record: Mapping[str, Any] = field(default_factory=dict)
    missing: Sequence[str] = ()
    seconds: float = 0.0
    stopped: bool = False

    @classmethod
    def of(
        cls, point: Point, problem: Problem, answer: Solution | Motion, record: Sequence[str]
    ) -> PointLine:
        """The line of the result of a problem, with the numbers at some dotted paths."""
        return cls(
            point,
            answer.status,
            answer.reason,
            objective=answer.objective.after,
            joints=joints_of(answer),
            placement=placement_of(problem, answer),
            record={path: recorded(answer, path) for path in record},
            missing=missing_arms(answer),
        )

    @property
    def text(self) -> str:
        """The line as JSON, its hash last."""
        line = {
            "point": self.point.number,
            "values": _finite(self.point.values),
            "seed": self.point.seed,
            "status": self.status,
            "reason": self.reason,
            "objective": self.objective,
            "joints": self.joints,
            "placement": self.placement,
            "record": self.record,
            "missing": self.missing,
            "seconds": round(self.seconds, 6),
            "stopped": self.stopped,
            "format": RECORD_FORMAT,
            "hash": self.point.point_hash.hex(),
        }
        return json.dumps(line, allow_nan=False, default=str)


def _finite(node: Any) -> Any:
    """Values without infinite numbers, which JSON does not have: ``inf`` and ``-inf`` as texts."""
    if isinstance(node, Mapping):
        return {key: _finite(value) for key, value in node.items()}
    if isinstance(node, (list, tuple)):
        return [_finite(value) for value in node]
    return str(node) if isinstance(node, float) and not math.isfinite(node) else node


def joints_of(answer: Solution | Motion) -> Mapping[str, Any] | None:
    """The joints of a solution by arm, of cases by case and arm; None of others."""
    if not isinstance(answer, Solution):
        return None
    if answer.cases:
        return {case.name: dict(case.joints) for case in answer.cases}
    return None if answer.after is None else dict(answer.after.joints)


def placement_of(problem: Problem, answer: Solution | Motion) -> Mapping[str, Any] | None:
    """The placement of a solution's freedom, as values of keys; of cases by case."""
    if not isinstance(answer, Solution) or not answer.freedom:
        return None
    if answer.cases:
        return {case.name: _places(problem, case) for case in answer.cases}
    return None if answer.after is None else _places(problem, answer.after)


def _places(problem: Problem, posture: Posture) -> dict[str, Any]:
    """The places of object, bases and grasps of a posture, those that the problem moves."""
    places: dict[str, Any] = {}
    if problem.object.freedom.ranges:
        where = posture.object.model_dump(mode="json").items()
        places = {f"object.{key}": value for key, value in where}
    for what, frames in (("base", posture.base), ("grasp", posture.grasp)):
        for arm, frame in (frames or {}).items():
            places[f"arms.{json.dumps(arm)}.{what}"] = frame.model_dump(mode="json")
    return places


def missing_arms(answer: Solution | Motion, closed: float = 1e-6) -> tuple[str, ...]:
    """Arms that miss their grasp in the nearest miss by more than counts as closed, m or rad."""
    miss: Posture | None = getattr(answer, "nearest_miss", None)
    if miss is None:
        return ()
    return tuple(arm for arm, error in miss.closure_error.items() if error > closed)


def recorded(answer: Solution | Motion, path: str) -> float | bool | None:
    """The number at a dotted path of a result; None where it does not exist there."""
    node: Any = answer
    for part in path.split("."):
        node = _child(node, part)
    if isinstance(node, float) and not math.isfinite(node):
        return None
    return node if isinstance(node, (int, float, bool)) else None


def _child(node: Any, part: str) -> Any:
    if isinstance(node, BaseModel):
        return getattr(node, part, None) if part in type(node).model_fields else None
    if isinstance(node, Mapping):
        return node.get(part)
    if isinstance(node, tuple) and part.isascii() and part.isdigit():
        return node[int(part[:9])] if int(part[:9]) < len(node) else None
    return None


def check_recorded(path: str, answer: type[BaseModel], key: str) -> None:
    """Refuse a dotted path, such as ``after.ellipsoid.radii.0``, that leads to no number of a class
    of results.

    Raises:
        InputError: it leads nowhere, or to what is no number.
    """
    kinds: list[Any] = [answer]
    for part in path.split("."):
        inner = [child for kind in kinds for child in _children(kind, part)]
        if not inner:
            names = [name for kind in kinds for name in getattr(kind, "model_fields", ())]
            hint = nearest(part, names) if names else ""
            raise InputError(f"{path!r}: results have no {part!r} there{hint}", key=key)
        kinds = inner
    if not any(kind in (float, int, bool) for kind in kinds):
        raise InputError(f"{path!r} is not one number; name a part of it", key=key)


def _children(kind: Any, part: str) -> list[Any]:
    """Types of what a part of a value of a type may be."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return _plain(kind.model_fields[part].annotation) if part in kind.model_fields else []
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is dict:
        return _plain(arguments[1])
    if origin is tuple and part.isascii() and part.isdigit():
        if len(arguments) == 2 and arguments[1] is Ellipsis:
            return _plain(arguments[0])
        return _plain(arguments[int(part[:9])]) if int(part[:9]) < len(arguments) else []
    return []


def _plain(annotation: Any) -> list[Any]:
    """The types that an annotation allows."""
    if get_origin(annotation) in (Union, UnionType):
        return [kind for each in get_args(annotation) for kind in _plain(each)]
    if get_origin(annotation) is Annotated:
        return _plain(get_args(annotation)[0])
    if get_origin(annotation) is not None and str(get_origin(annotation)) == "typing.Literal":
        return [str]
    return [annotation]
