"""``[path]``: the object's way through the world, and how the joint motion along it is chosen."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, PlainValidator, WithJsonSchema
from pydantic_core import PydanticCustomError

from copose.problem.fields import NotNegative, Number, Pair, Positive, Spec, Triple
from copose.problem.objects import Oriented


def _duration(value: Any) -> Any:
    if value == "shortest":
        return value
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        if 1e-3 <= value <= 1e5:
            return float(value)
        raise PydanticCustomError("copose", "must be from 0.001 to 1e5 s")
    raise PydanticCustomError("copose", "must be a number of seconds, or 'shortest'")


Duration: TypeAlias = Annotated[
    float | Literal["shortest"],
    PlainValidator(_duration),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "number", "minimum": 1e-3, "maximum": 1e5},
                {"const": "shortest", "type": "string"},
            ]
        }
    ),
]


class Waypoint(Oriented):
    """A pose of the object in the world; what it leaves out is the previous one's.

    Attributes:
        position: centre of mass in the world, m; left out, the previous one's.
    """

    position: Triple | None = None


class PlanarWaypoint(Spec):
    """A pose of the object in the plane; what it leaves out is the previous one's.

    Attributes:
        position: centre of mass in the world, m; left out, the previous one's.
        angle: angle of the object in the world, rad; left out, the previous one's.
    """

    position: Pair | None = None
    angle: Number | None = None


class PathSpec(Spec):
    """``[path]``.

    Attributes:
        waypoints: poses in place of the object's; what the first leaves out is the object's.
        duration: how long it takes, s, or the shortest within the limits.
        knots: uniform in time, both ends included.
        aggregate: of the objective over the knots.
        smoothness: how much joint speeds count, s²/rad² per unit of the objective.
        closed: whether it ends in the posture it began with.
        tolerance: what the chain may be open between knots, m or rad.
    """

    waypoints: tuple[Waypoint, ...] | tuple[PlanarWaypoint, ...]
    duration: Duration = 2.0
    knots: Annotated[int, Field(ge=2, le=2000)] = 50
    aggregate: Literal["mean", "worst"] = "mean"
    smoothness: NotNegative = 0.01
    closed: bool = False
    tolerance: Positive = 1e-4


class SpatialPath(PathSpec):
    """``[path]`` in space."""

    waypoints: Annotated[tuple[Waypoint, ...], Field(min_length=2, max_length=100)]


class PlanarPath(PathSpec):
    """``[path]`` in the plane."""

    waypoints: Annotated[tuple[PlanarWaypoint, ...], Field(min_length=2, max_length=100)]
