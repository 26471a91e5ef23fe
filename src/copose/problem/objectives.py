"""What is wanted: the ellipsoid, the objective on it, the world it is in."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, WithJsonSchema

from copose.errors import shown
from copose.problem.fields import Direction, Number, Pair, Spec, Triple, not_zero


class EllipsoidSpec(Spec):
    """``[ellipsoid]``: which of the dynamic manipulability ellipsoids is meant.

    Attributes:
        resolution: which joint torques: the paper's, or with null motion and internal force chosen
            to spend the least torque.
        torque_scaling: a ball of unit torques, or each torque over its limit.
        load_distribution: which generalised inverse shares the load between the arms.
        gravity: whether the centre of the ellipsoid includes gravity.
    """

    resolution: Literal["pseudoinverse", "torque-optimal"] = "pseudoinverse"
    torque_scaling: Literal["unit", "limits"] = "unit"
    load_distribution: Literal["moore-penrose", "nonsqueezing"] = "moore-penrose"
    gravity: bool = False


class WorldSpec(Spec):
    """``[world]`` in space.

    Attributes:
        gravity: acceleration of free fall in world axes, m/s².
    """

    gravity: Triple = (0.0, 0.0, -9.81)


class PlanarWorldSpec(Spec):
    """``[world]`` in the plane.

    Attributes:
        gravity: acceleration of free fall in world axes, m/s².
    """

    gravity: Pair = (0.0, 0.0)


class EllipsoidObjective(Spec):
    """What objectives on the ellipsoid have in common: a coordinate slice of the task space.

    Attributes:
        kind: what is maximised.
        axes: coordinates of the task space that count, such as x; the other accelerations are held
            at zero; left out, all count.
    """

    axes: tuple[str, ...] | None = None


class VolumeObjective(EllipsoidObjective):
    """The log-volume of the ellipsoid."""

    kind: Literal["volume"] = "volume"


class WorstDirectionObjective(EllipsoidObjective):
    """The shortest semi-axis of the ellipsoid."""

    kind: Literal["worst-direction"]


class IsotropyObjective(EllipsoidObjective):
    """Shortest over longest semi-axis of the ellipsoid."""

    kind: Literal["isotropy"]


class WeightedDirection(Spec):
    """A task direction, and how much being fast (> 0) or fine (< 0) along it counts.

    Attributes:
        direction: task vector, linear over angular, of any length.
        weight: how much it counts, not 0.
    """

    direction: Direction
    weight: Annotated[Number, AfterValidator(not_zero)] = 1.0


class TaskCompatibilityObjective(EllipsoidObjective):
    """Σ w log d(u) over directions u.

    Attributes:
        directions: directions along which the object is to be fast or fine.
    """

    kind: Literal["task-compatibility"]
    directions: Annotated[tuple[WeightedDirection, ...], Field(min_length=1, max_length=64)]


class VelocityVolumeObjective(EllipsoidObjective):
    """The log-volume of the closed chain's velocity ellipsoid."""

    kind: Literal["velocity-volume"]


class ForceVolumeObjective(EllipsoidObjective):
    """The log-volume of the ellipsoid of external wrenches, shared by W⁺."""

    kind: Literal["force-volume"]


class PlainDirection(Spec):
    """A task direction.

    Attributes:
        direction: task vector, linear over angular, of any length.
    """

    direction: Direction


_DIRECTION = {"type": "array", "items": {"type": "number"}}
_DIRECTIONS = {
    "type": "array",
    "minItems": 1,
    "maxItems": 16,
    "items": {
        "anyOf": [
            _DIRECTION,
            {
                "type": "object",
                "properties": {"direction": _DIRECTION},
                "required": ["direction"],
                "additionalProperties": False,
            },
        ]
    },
}


def _as_directions(value: Any) -> Any:
    """Bare arrays stand for tables with a direction."""
    if not isinstance(value, tuple):
        return value
    return tuple({"direction": entry} if isinstance(entry, tuple) else entry for entry in value)


class AccelerationObjective(EllipsoidObjective):
    """The largest acceleration along a direction; of several directions the smallest counts.

    Attributes:
        direction: task vector, of any length, along which the object is to accelerate; or give
            directions.
        directions: several such, of which the smallest acceleration counts.
    """

    kind: Literal["acceleration"]
    direction: Direction | None = None
    directions: Annotated[
        tuple[PlainDirection, ...] | None,
        BeforeValidator(_as_directions),
        Field(min_length=1, max_length=16),
        WithJsonSchema(_DIRECTIONS),
    ] = None

    @property
    def wanted(self) -> tuple[tuple[float, ...], ...]:
        """Its directions, however they are given."""
        if self.direction is not None:
            return (self.direction,)
        return tuple(entry.direction for entry in self.directions or ())


class PayloadObjective(EllipsoidObjective):
    """The largest mass that can be held at rest, or accelerated along a direction.

    Attributes:
        acceleration: along the direction, m/s² or rad/s²; left out, the mass is held at rest.
        direction: task vector along which the mass is to be accelerated.
    """

    kind: Literal["payload"]
    acceleration: Number | None = None
    direction: Direction | None = None


class AllRoundObjective(EllipsoidObjective):
    """The radius of the largest ball of accelerations around rest."""

    kind: Literal["all-round"]


def _objective_kind(value: Any) -> str:
    kind = value.get("kind", "volume") if isinstance(value, dict) else getattr(value, "kind", "")
    return kind if isinstance(kind, str) else shown(kind)


ObjectiveSpec: TypeAlias = Annotated[
    Annotated[VolumeObjective, Tag("volume")]
    | Annotated[WorstDirectionObjective, Tag("worst-direction")]
    | Annotated[IsotropyObjective, Tag("isotropy")]
    | Annotated[TaskCompatibilityObjective, Tag("task-compatibility")]
    | Annotated[AccelerationObjective, Tag("acceleration")]
    | Annotated[PayloadObjective, Tag("payload")]
    | Annotated[AllRoundObjective, Tag("all-round")]
    | Annotated[VelocityVolumeObjective, Tag("velocity-volume")]
    | Annotated[ForceVolumeObjective, Tag("force-volume")],
    Discriminator(_objective_kind),
]
