"""The arms, by URDF or by their links, and what they carry."""

from __future__ import annotations

from typing import Annotated, Any, TypeAlias

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from copose.problem.freedom import ArmFreedom, PlanarArmFreedom
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
    Torque,
    Triple,
)

_MOST_LINKS = 32

FilePath: TypeAlias = Annotated[str, Field(min_length=1, max_length=4000)]


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


class Grip(Spec):
    """The largest norms of the contact's force, N, and moment, N·m."""

    force: Positive | None = None
    moment: Positive | None = None

    @property
    def endless(self) -> bool:
        """Whether it bears everything."""
        return self.force is None and self.moment is None


def _without(data: Any, key: str, text: str) -> Any:
    """Refuse the key that tells an arm of the other spaces, before its others are unknown."""
    if isinstance(data, dict) and key in data:
        raise PydanticCustomError("copose", "{text}", {"text": text})
    return data


class ArmSpec(Spec):
    """What arms of both kinds have in common; arrays go by free joints, root to tip."""

    name: Name
    start: tuple[Number, ...] | None = None
    torque_limits: tuple[Torque, ...] | None = None
    position_limits: tuple[Range, ...] | None = None
    velocity_limits: tuple[Positive, ...] | None = None
    acceleration_limits: tuple[Positive, ...] | None = None
    armature: tuple[NotNegative, ...] | None = None
    grip: Grip = Grip()
    fixed: bool = False
    freedom: ArmFreedom | PlanarArmFreedom = ArmFreedom()

    @model_validator(mode="after")
    def _held_somewhere(self) -> ArmSpec:
        if self.fixed and self.start is None:
            raise PydanticCustomError(
                "copose", "a fixed arm is held at its start, which is missing; give one"
            )
        return self


class UrdfArm(ArmSpec):
    """``[[arms]]`` with a URDF: the chain from ``root`` to ``tip``.

    ``packages`` says in which folders, relative to the problem file, the packages lie that
    ``package://…`` names, in ``urdf`` and in that file; what it does not name is looked for on
    ROS_PACKAGE_PATH and AMENT_PREFIX_PATH.
    """

    urdf: FilePath
    packages: dict[str, FilePath] = Field(default_factory=dict)
    root: Text | None = None
    tip: Text
    locked: dict[str, Number] = Field(default_factory=dict)
    base: Placement = Placement()
    grasp: Grasp
    freedom: ArmFreedom = ArmFreedom()
    tool: Tool | None = None

    @model_validator(mode="before")
    @classmethod
    def _kind(cls, data: Any) -> Any:
        return _without(
            data,
            "links",
            "an arm by its links belongs to the planar spaces; here give urdf and tip",
        )


class PlanarArm(ArmSpec):
    """``[[arms]]`` with links: a planar chain of revolute joints."""

    links: Annotated[tuple[Link, ...], Field(min_length=1, max_length=_MOST_LINKS)]
    base: PlanarPlacement = PlanarPlacement()
    grasp: PlanarGrasp
    freedom: PlanarArmFreedom = PlanarArmFreedom()
    tool: PlanarTool | None = None

    @model_validator(mode="before")
    @classmethod
    def _kind(cls, data: Any) -> Any:
        return _without(
            data, "urdf", "an arm by its URDF belongs to the spatial spaces; here give links"
        )
