"""What is wanted: the ellipsoid, the objective on it, the world it is in."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag

from copose.errors import shown
from copose.problem.values import Direction, Number, Pair, Spec, Triple, not_zero


class EllipsoidSpec(Spec):
    """``[ellipsoid]``: which of the dynamic manipulability ellipsoids is meant."""

    resolution: Literal["pseudoinverse", "torque-optimal"] = "pseudoinverse"
    torque_scaling: Literal["unit", "limits"] = "unit"
    load_distribution: Literal["moore-penrose", "nonsqueezing"] = "moore-penrose"
    gravity: bool = False


class WorldSpec(Spec):
    """``[world]`` in space."""

    gravity: Triple = (0.0, 0.0, -9.81)


class PlanarWorldSpec(Spec):
    """``[world]`` in the plane."""

    gravity: Pair = (0.0, 0.0)


class EllipsoidObjective(Spec):
    """What objectives on the ellipsoid have in common: a coordinate slice of the task space."""

    axes: tuple[str, ...] | None = None


class VolumeObjective(EllipsoidObjective):
    """The log-volume."""

    kind: Literal["volume"] = "volume"


class WorstDirectionObjective(EllipsoidObjective):
    """The shortest semi-axis."""

    kind: Literal["worst-direction"]


class IsotropyObjective(EllipsoidObjective):
    """Shortest over longest semi-axis."""

    kind: Literal["isotropy"]


class WeightedDirection(Spec):
    """A task direction, and how much being fast (> 0) or fine (< 0) along it counts."""

    direction: Direction
    weight: Annotated[Number, AfterValidator(not_zero)] = 1.0


class TaskCompatibilityObjective(EllipsoidObjective):
    """Σ w log d(u) over directions u."""

    kind: Literal["task-compatibility"]
    directions: Annotated[tuple[WeightedDirection, ...], Field(min_length=1, max_length=64)]


class VelocityVolumeObjective(EllipsoidObjective):
    """The log-volume of the closed chain's velocity ellipsoid."""

    kind: Literal["velocity-volume"]


class ForceVolumeObjective(EllipsoidObjective):
    """The log-volume of the ellipsoid of external wrenches, shared by W⁺."""

    kind: Literal["force-volume"]


class PlainDirection(Spec):
    """A task direction."""

    direction: Direction


def _as_directions(value: Any) -> Any:
    """Bare arrays stand for tables with a direction."""
    if not isinstance(value, tuple):
        return value
    return tuple({"direction": entry} if isinstance(entry, tuple) else entry for entry in value)


class AccelerationObjective(EllipsoidObjective):
    """The largest acceleration along a direction, or the smallest of several such."""

    kind: Literal["acceleration"]
    direction: Direction | None = None
    directions: Annotated[
        tuple[PlainDirection, ...] | None,
        BeforeValidator(_as_directions),
        Field(min_length=1, max_length=16),
    ] = None

    @property
    def wanted(self) -> tuple[tuple[float, ...], ...]:
        """Its directions, however they are given."""
        if self.direction is not None:
            return (self.direction,)
        return tuple(entry.direction for entry in self.directions or ())


class PayloadObjective(EllipsoidObjective):
    """The largest mass that can be held still, or accelerated along a direction, m/s²."""

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
