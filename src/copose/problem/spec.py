"""What is asked: a problem file as frozen, validated data (SI units, radians)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PrivateAttr,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from copose.poses import Pose
from copose.problem.spaces import SPACES, Space, SpaceName

_LARGEST = 1e6
_SMALLEST = 1e-12
_MOST_ARMS = 32
_MOST_LINKS = 32

Number: TypeAlias = Annotated[float, Field(allow_inf_nan=False, ge=-_LARGEST, le=_LARGEST)]
Positive: TypeAlias = Annotated[float, Field(allow_inf_nan=False, ge=_SMALLEST, le=_LARGEST)]
NotNegative: TypeAlias = Annotated[float, Field(allow_inf_nan=False, ge=0, le=_LARGEST)]
Pair: TypeAlias = tuple[Number, Number]
Triple: TypeAlias = tuple[Number, Number, Number]
Matrix3: TypeAlias = tuple[Triple, Triple, Triple]
Text: TypeAlias = Annotated[str, Field(max_length=10_000)]


def _name(value: str) -> str:
    if not value.strip() or not value.isprintable() or len(value.encode()) > 100:
        raise PydanticCustomError("copose", "must be a visible name of at most 100 bytes")
    return value


def _folder_name(value: str) -> str:
    if value.strip(". ") == "" or "/" in value or "\\" in value:
        raise PydanticCustomError(
            "copose", "must be a name without '/' or '\\': it names the output folder"
        )
    return _name(value)


def _limit(value: float) -> float:
    if math.isnan(value) or _LARGEST < abs(value) < math.inf:
        raise PydanticCustomError("copose", "must be within ±1e6, or ±inf for none")
    return value


def _whole(value: Any) -> Any:
    if type(value) is not int:
        raise PydanticCustomError("copose", "must be a whole number")
    return value


def _range(pair: tuple[float, float]) -> tuple[float, float]:
    if pair[0] >= pair[1]:
        raise PydanticCustomError("copose", "crossed limits: lower must be below upper")
    return pair


def _inertia_matrix(value: object) -> object:
    """Three principal moments become the diagonal matrix they stand for."""
    if not isinstance(value, tuple) or len(value) != 3:
        raise PydanticCustomError("copose", "must be 3 diagonal entries or a 3×3 matrix")
    if all(isinstance(entry, tuple) for entry in value):
        return value
    return tuple(tuple(entry if i == j else 0.0 for j in range(3)) for i, entry in enumerate(value))


def _physical_inertia(inertia: Matrix3) -> Matrix3:
    matrix = np.array(inertia)
    size = float(np.abs(matrix).max())
    if not np.allclose(matrix, matrix.T, rtol=0, atol=1e-9 * size):
        raise PydanticCustomError("copose", "must be symmetric")
    moments = np.linalg.eigvalsh(matrix)
    if moments[0] < max(1e-9 * size, 1e-15):
        raise PydanticCustomError("copose", "must be positive definite")
    if moments[2] > (moments[0] + moments[1]) * (1 + 1e-9):
        raise PydanticCustomError(
            "copose",
            "violates the triangle inequality: no principal moment may exceed the sum of the "
            "other two",
        )
    return inertia


Name: TypeAlias = Annotated[str, AfterValidator(_name)]
FolderName: TypeAlias = Annotated[str, AfterValidator(_folder_name)]
Limit: TypeAlias = Annotated[float, AfterValidator(_limit)]
Range: TypeAlias = Annotated[tuple[Limit, Limit], AfterValidator(_range)]
Inertia: TypeAlias = Annotated[
    Matrix3, BeforeValidator(_inertia_matrix), AfterValidator(_physical_inertia)
]


class Spec(BaseModel):
    """The root of every table: frozen, no unknown keys, no silent conversion."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class Task(Spec):
    """``[task]``."""

    space: SpaceName


class Box(Spec):
    """A box by its edge lengths, m."""

    kind: Literal["box"]
    size: tuple[Positive, Positive, Positive]


class Sphere(Spec):
    """A sphere."""

    kind: Literal["sphere"]
    radius: Positive


class Cylinder(Spec):
    """A cylinder along z."""

    kind: Literal["cylinder"]
    radius: Positive
    length: Positive


class Rectangle(Spec):
    """A planar box by its width and height, m."""

    kind: Literal["box"]
    size: tuple[Positive, Positive]


class Disk(Spec):
    """A disk."""

    kind: Literal["disk"]
    radius: Positive


SpatialShape: TypeAlias = Annotated[Box | Sphere | Cylinder, Field(discriminator="kind")]
PlanarShape: TypeAlias = Annotated[Rectangle | Disk, Field(discriminator="kind")]
Shape: TypeAlias = Box | Sphere | Cylinder | Rectangle | Disk


class SpatialObject(Spec):
    """``[object]`` in space: pose of its centre of mass, mass, inertia about it."""

    mass: Positive
    inertia: Inertia | None = None
    position: Triple
    rpy: Triple = (0.0, 0.0, 0.0)
    shape: SpatialShape | None = None

    @property
    def pose(self) -> Pose:
        """Placement of the centre of mass in the world."""
        return Pose.from_rpy(self.position, self.rpy)


class PlanarObject(Spec):
    """``[object]`` in the plane."""

    mass: Positive
    inertia: Positive | None = None
    position: Pair
    angle: Number = 0.0
    shape: PlanarShape | None = None

    @property
    def pose(self) -> Pose:
        """Placement of the centre of mass in the world."""
        return _planar_pose(self.position, self.angle)


def _planar_pose(position: Pair, angle: float) -> Pose:
    return Pose.from_rpy((*position, 0.0), (0.0, 0.0, angle))


class Placement(Spec):
    """Position and fixed-axis roll, pitch, yaw of a frame in another."""

    position: Triple = (0.0, 0.0, 0.0)
    rpy: Triple = (0.0, 0.0, 0.0)

    @property
    def pose(self) -> Pose:
        """The same as a pose."""
        return Pose.from_rpy(self.position, self.rpy)


class PlanarPlacement(Spec):
    """Position and angle of a frame in another, in the plane."""

    position: Pair = (0.0, 0.0)
    angle: Number = 0.0

    @property
    def pose(self) -> Pose:
        """The same as a pose."""
        return _planar_pose(self.position, self.angle)


class Grasp(Placement):
    """Placement of the tip frame in the object frame."""

    position: Triple


class PlanarGrasp(PlanarPlacement):
    """Placement of the tip frame in the object frame, in the plane."""

    position: Pair


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
    locked: dict[str, Number] = {}
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


class EllipsoidSpec(Spec):
    """``[ellipsoid]``: which of the dynamic manipulability ellipsoids is meant."""

    resolution: Literal["pseudoinverse"] = "pseudoinverse"
    torque_scaling: Literal["unit"] = "unit"
    load_distribution: Literal["moore-penrose"] = "moore-penrose"
    gravity: Literal[False] = False


class ObjectiveSpec(Spec):
    """``[objective]``: what is maximised."""

    kind: Literal["volume"] = "volume"


class ConstraintsSpec(Spec):
    """``[constraints]``: what a posture must keep."""

    joint_margin: NotNegative = 0.0


class SearchSpec(Spec):
    """``[search]``: how postures are searched."""

    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0


class Problem(Spec):
    """A problem file; `copose.load` reads one, `copose.parse` takes the same as a dict."""

    format: Annotated[Literal[1], BeforeValidator(_whole)]
    name: FolderName
    description: Text = ""
    task: Task
    object: SpatialObject | PlanarObject
    arms: tuple[UrdfArm, ...] | tuple[PlanarArm, ...]
    ellipsoid: EllipsoidSpec = EllipsoidSpec()
    objective: ObjectiveSpec = ObjectiveSpec()
    constraints: ConstraintsSpec = ConstraintsSpec()
    search: SearchSpec = SearchSpec()

    _source: Path | None = PrivateAttr(None)

    @property
    def source(self) -> Path | None:
        """The file that the problem was read from."""
        return self._source

    @property
    def space(self) -> Space:
        """The task space."""
        return SPACES[self.task.space]

    @field_validator("arms", check_fields=False)
    @classmethod
    def _distinct(cls, arms: tuple[ArmSpec, ...]) -> tuple[ArmSpec, ...]:
        names = [arm.name for arm in arms]
        for name in names:
            if names.count(name) > 1:
                raise PydanticCustomError(
                    "copose", "two arms are called {name}; give each its own", {"name": repr(name)}
                )
        return arms

    @model_validator(mode="after")
    def _inertia_where_it_counts(self) -> Problem:
        if self.space.rigid and self.object.inertia is None:
            raise PydanticCustomError(
                "copose_key",
                "missing; space {space} needs the object's inertia",
                {"key": "object.inertia", "space": repr(self.task.space)},
            )
        return self


class SpatialProblem(Problem):
    """A problem in one of the spatial spaces."""

    object: SpatialObject
    arms: Annotated[tuple[UrdfArm, ...], Field(min_length=1, max_length=_MOST_ARMS)]


class PlanarProblem(Problem):
    """A problem in one of the planar spaces."""

    object: PlanarObject
    arms: Annotated[tuple[PlanarArm, ...], Field(min_length=1, max_length=_MOST_ARMS)]
