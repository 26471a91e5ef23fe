"""The arms, by URDF or by their links, and what they carry."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from copose.problem.objects import Grasp, Placement, PlanarGrasp, PlanarPlacement
from copose.problem.values import (
    Inertia,
    Name,
    NotNegative,
    Number,
    Pair,
    Positive,
    Range,
    Spec,
    Text,
    Triple,
)

_MOST_LINKS = 32


class Tool(Spec):
    """A body fixed to the tip: mass, centre of mass and inertia about it, in tip axes."""

    mass: Positive
    com: Triple
    inertia: Inertia


class PlanarTool(Spec):
    """A body fixed to the tip, in the plane."""

    mass: Positive
    com: Pair
    inertia: Positive


class Link(Spec):
    """A link of a planar arm; ``com`` along it from its joint, inertia about its own com."""

    length: Positive
    mass: Positive
    inertia: Positive
    com: Number
    radius: Positive = 0.03


class ArmSpec(Spec):
    """What arms of both kinds have in common; arrays go by free joints, root to tip."""

    name: Name
    start: tuple[Number, ...] | None = None
    torque_limits: tuple[Positive, ...] | None = None
    position_limits: tuple[Range, ...] | None = None
    armature: tuple[NotNegative, ...] | None = None


class UrdfArm(ArmSpec):
    """``[[arms]]`` with a URDF: the chain from ``root`` to ``tip``."""

    urdf: Annotated[str, Field(min_length=1, max_length=4000)]
    root: Text | None = None
    tip: Text
    locked: dict[str, Number] = Field(default_factory=dict)
    base: Placement = Placement()
    grasp: Grasp
    tool: Tool | None = None

    @model_validator(mode="before")
    @classmethod
    def _kind(cls, data: Any) -> Any:
        if isinstance(data, dict) and "links" in data:
            raise PydanticCustomError(
                "copose", "an arm by its links belongs to the planar spaces; here give urdf and tip"
            )
        return data


class PlanarArm(ArmSpec):
    """``[[arms]]`` with links: a planar chain of revolute joints."""

    links: Annotated[tuple[Link, ...], Field(min_length=1, max_length=_MOST_LINKS)]
    base: PlanarPlacement = PlanarPlacement()
    grasp: PlanarGrasp
    tool: PlanarTool | None = None

    @model_validator(mode="before")
    @classmethod
    def _kind(cls, data: Any) -> Any:
        if isinstance(data, dict) and "urdf" in data:
            raise PydanticCustomError(
                "copose", "an arm by its URDF belongs to the spatial spaces; here give links"
            )
        return data
