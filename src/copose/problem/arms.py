"""The arms, by URDF or by their links, and what they carry."""

from __future__ import annotations

from typing import Annotated, Any, TypeAlias

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from copose.problem.fields import (
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
from copose.problem.freedom import ArmFreedom, PlanarArmFreedom
from copose.problem.objects import Grasp, Placement, PlanarGrasp, PlanarPlacement

XacroArgument: TypeAlias = Text | bool | int | float
FilePath: TypeAlias = Annotated[str, Field(min_length=1, max_length=4000)]


class Tool(Spec):
    """A body fixed to the tip: mass, centre of mass and inertia about it, in tip axes.

    Attributes:
        mass: its mass, kg.
        com: centre of mass in tip axes, m.
        inertia: about the centre of mass, kg·m²: 3 diagonal entries or 3×3.
    """

    mass: Positive
    com: Triple
    inertia: Inertia


class PlanarTool(Spec):
    """A body fixed to the tip, in the plane.

    Attributes:
        mass: its mass, kg.
        com: centre of mass in tip axes, m.
        inertia: about the centre of mass, kg·m².
    """

    mass: Positive
    com: Pair
    inertia: Positive


class Link(Spec):
    """A link of a planar arm; ``com`` along it from its joint, inertia about its own com.

    Attributes:
        length: from joint to joint, m.
        mass: its mass, kg.
        inertia: about its own centre of mass, kg·m².
        com: centre of mass along it from its joint, m.
        radius: its half width, m.
    """

    length: Positive
    mass: Positive
    inertia: Positive
    com: Number
    radius: Positive = 0.03


class Grip(Spec):
    """The largest norms of the contact's force, N, and moment, N·m.

    Attributes:
        force: largest norm of the contact force, N; left out, any.
        moment: largest norm of the contact moment, N·m; left out, any.
    """

    force: Positive | None = None
    moment: Positive | None = None

    @property
    def endless(self) -> bool:
        """True where the contact bears everything."""
        return self.force is None and self.moment is None


def _without(data: Any, key: str, text: str) -> Any:
    """Refuse the key that tells an arm of the other spaces, before its others are unknown."""
    if isinstance(data, dict) and key in data:
        raise PydanticCustomError("copose", "{text}", {"text": text})
    return data


class ArmSpec(Spec):
    """Arms of both kinds: their common keys; arrays go by free joints, root to tip.

    Attributes:
        name: its name, which no other arm has.
        start: joint positions of the posture before, rad or m; left out, a MuJoCo model's keyframe
            or the seed gives them.
        torque_limits: largest torques, N·m or N, inf for none; left out, the robot file's.
        position_limits: [lower, upper] of each joint, rad or m, ±inf for none; left out, the robot
            file's.
        velocity_limits: largest speeds, rad/s or m/s; left out, the robot file's.
        acceleration_limits: largest accelerations, rad/s² or m/s²; left out, none.
        armature: inertia of the rotors reflected through the gears, kg·m² or kg; left out, a MuJoCo
            model's, and of other arms none.
        grip: how much the contact bears; left out, anything.
        fixed: whether the arm does not move but stays at its start.
        freedom: how far copose may move base and grasp.
    """

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


class RobotArm(ArmSpec):
    """``[[arms]]`` with a URDF or a MuJoCo model: the chain from ``root`` to ``tip``.

    ``packages`` says in which folders, relative to the problem file, the packages lie that
    ``package://…`` names, in ``urdf`` and in that file; what it does not name is looked for on
    ROS_PACKAGE_PATH and AMENT_PREFIX_PATH.

    Attributes:
        urdf: a URDF or .xacro: relative to this file, package://…, example-robot-data://… or
            robot_descriptions://NAME; left out beside mjcf.
        mjcf: a MuJoCo model, read by the package mujoco, extra [mjcf]; left out beside urdf.
        xacro_args: arguments of a .xacro, by name.
        packages: folders of packages that package://… names, relative to this file.
        root: first link of the chain, which base places; left out, the file's root link.
        tip: link that grasps, whose frame grasp places; of a MuJoCo model a site or a body.
        locked: positions of movable joints that are held still, by name, rad or m; others off the
            chain are held at 0.
        ignore_collisions: pairs of links that may touch, beside those that an SRDF of the file's
            name beside it disables, and those that a MuJoCo model excludes.
        base: pose of the root link in the world.
        grasp: pose of the tip frame in the object frame; left out beside a start, where the tip is
            then.
        tool: a body fixed to the tip; left out, none.
    """

    urdf: FilePath | None = None
    mjcf: FilePath | None = None
    xacro_args: dict[str, XacroArgument] = Field(default_factory=dict)
    packages: dict[str, FilePath] = Field(default_factory=dict)
    root: Text | None = None
    tip: Text
    locked: dict[str, Number] = Field(default_factory=dict)
    ignore_collisions: tuple[tuple[Text, Text], ...] = ()
    base: Placement = Placement()
    grasp: Grasp
    freedom: ArmFreedom = ArmFreedom()
    tool: Tool | None = None

    @property
    def kind(self) -> str:
        """Kind of its file, and the key that names it."""
        return "urdf" if self.mjcf is None else "mjcf"

    @property
    def file(self) -> str:
        """The robot's file, as it is named."""
        return self.urdf or self.mjcf or ""

    @model_validator(mode="before")
    @classmethod
    def _kind(cls, data: Any) -> Any:
        return _without(
            data,
            "links",
            "an arm by its links belongs to the planar spaces; here give urdf and tip",
        )

    @model_validator(mode="after")
    def _one_file(self) -> RobotArm:
        if (self.urdf is None) == (self.mjcf is None):
            text = "urdf is missing, or mjcf for a MuJoCo model"
            if self.mjcf is not None:
                text = "has urdf and mjcf; give the one that its robot is read from"
            raise PydanticCustomError("copose", "{text}", {"text": text})
        return self


class PlanarArm(ArmSpec):
    """``[[arms]]`` with links: a planar chain of revolute joints.

    Attributes:
        links: from the base to the tip.
        base: first joint in the world.
        grasp: tip frame in the object's; left out beside a start, where the tip is then.
        tool: a body fixed to the tip; left out, none.
    """

    links: Annotated[tuple[Link, ...], Field(min_length=1, max_length=32)]
    base: PlanarPlacement = PlanarPlacement()
    grasp: PlanarGrasp
    freedom: PlanarArmFreedom = PlanarArmFreedom()
    tool: PlanarTool | None = None

    @model_validator(mode="before")
    @classmethod
    def _kind(cls, data: Any) -> Any:
        for key, what in (("urdf", "URDF"), ("mjcf", "MuJoCo model")):
            text = f"an arm by its {what} belongs to the spatial spaces; here give links"
            data = _without(data, key, text)
        return data
