"""What is wanted: the ellipsoid, the objective on it, the world it is in."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import AfterValidator, Discriminator, Field, Tag

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


def _objective_kind(value: Any) -> str:
    kind = value.get("kind", "volume") if isinstance(value, dict) else getattr(value, "kind", "")
    return kind if isinstance(kind, str) else shown(kind)


ObjectiveSpec: TypeAlias = Annotated[
    Annotated[VolumeObjective, Tag("volume")]
    | Annotated[WorstDirectionObjective, Tag("worst-direction")]
    | Annotated[IsotropyObjective, Tag("isotropy")]
    | Annotated[TaskCompatibilityObjective, Tag("task-compatibility")],
    Discriminator(_objective_kind),
]
