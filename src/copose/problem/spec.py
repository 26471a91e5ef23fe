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
    Discriminator,
    Field,
    PrivateAttr,
    Tag,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from copose.errors import shown
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


def _fault(key: str, text: str) -> PydanticCustomError:
    """What is wrong with a key that only the whole problem can judge."""
    return PydanticCustomError("copose_key", "{text}", {"key": key, "text": text})


def _not_zero(value: float) -> float:
    if value == 0:
        raise PydanticCustomError("copose", "must not be zero")
    return value


def _direction(value: tuple[float, ...]) -> tuple[float, ...]:
    if not math.hypot(*value) > 1e-9:
        raise PydanticCustomError("copose", "must not be zero")
    return value


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
Direction: TypeAlias = Annotated[tuple[Number, ...], AfterValidator(_direction)]
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
    velocity: tuple[Number, ...] | None = None

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
    velocity: tuple[Number, ...] | None = None

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
    weight: Annotated[Number, AfterValidator(_not_zero)] = 1.0


class TaskCompatibilityObjective(EllipsoidObjective):
    """Σ w log d(u) over directions u."""

    kind: Literal["task-compatibility"]
    directions: Annotated[tuple[WeightedDirection, ...], Field(min_length=1, max_length=64)]


def _objective_kind(value: Any) -> str:
    if isinstance(value, dict):
        return str(value.get("kind", "volume"))
    return str(getattr(value, "kind", ""))


ObjectiveSpec: TypeAlias = Annotated[
    Annotated[VolumeObjective, Tag("volume")]
    | Annotated[WorstDirectionObjective, Tag("worst-direction")]
    | Annotated[IsotropyObjective, Tag("isotropy")]
    | Annotated[TaskCompatibilityObjective, Tag("task-compatibility")],
    Discriminator(_objective_kind),
]


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
    objective: ObjectiveSpec = VolumeObjective()
    world: WorldSpec | PlanarWorldSpec = WorldSpec()
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

    @property
    def axes(self) -> tuple[int, ...]:
        """Indices, within the task vector, of the coordinates that the ellipsoid keeps."""
        names = self.objective.axes
        coordinates = self.space.coordinates
        if names is None:
            return tuple(range(self.space.m))
        return tuple(coordinates.index(name) for name in names)

    @model_validator(mode="after")
    def _tasks_fit(self) -> Problem:
        m, velocity = self.space.m, self.object.velocity
        if velocity is not None and len(velocity) != m:
            raise _fault("object.velocity", f"has {len(velocity)} entries; {m} are needed")
        names = self.objective.axes
        if names is not None:
            self._check_axes(names)
        if isinstance(self.objective, TaskCompatibilityObjective):
            for i, weighted in enumerate(self.objective.directions):
                self._check_direction(weighted.direction, f"objective.directions[{i}].direction")
        return self

    def _check_axes(self, names: tuple[str, ...]) -> None:
        legal = self.space.coordinates
        if not names:
            raise _fault("objective.axes", f"is empty; allowed: {', '.join(legal)}")
        for i, name in enumerate(names):
            if name not in legal:
                raise _fault(
                    f"objective.axes[{i}]",
                    f"{shown(name)} is no coordinate of space {self.task.space!r}; allowed: "
                    + ", ".join(legal),
                )
            if name in names[:i]:
                raise _fault(f"objective.axes[{i}]", f"{shown(name)} is named twice")

    def _check_direction(self, direction: tuple[float, ...], key: str) -> None:
        m, a = self.space.m, len(self.axes)
        if len(direction) not in (m, a):
            wanted = f"{m}" if a == m else f"{m} or {a}"
            raise _fault(key, f"has {len(direction)} entries; {wanted} are needed")
        if len(direction) == m and a < m:
            outside = [c for i, c in enumerate(self.space.coordinates) if i not in self.axes]
            if any(direction[self.space.coordinates.index(c)] != 0 for c in outside):
                raise _fault(key, f"points outside axes: {', '.join(outside)} must be 0")

    def along(self, direction: tuple[float, ...]) -> tuple[float, ...]:
        """A direction of the file as a unit vector over ``axes``."""
        if len(direction) == self.space.m:
            direction = tuple(direction[i] for i in self.axes)
        norm = math.hypot(*direction)
        return tuple(x / norm for x in direction)

    @model_validator(mode="after")
    def _inertia_where_it_counts(self) -> Problem:
        if self.space.rigid and self.object.inertia is None:
            raise _fault(
                "object.inertia", f"missing; space {self.task.space!r} needs the object's inertia"
            )
        return self


class SpatialProblem(Problem):
    """A problem in one of the spatial spaces."""

    object: SpatialObject
    world: WorldSpec = WorldSpec()
    arms: Annotated[tuple[UrdfArm, ...], Field(min_length=1, max_length=_MOST_ARMS)]


class PlanarProblem(Problem):
    """A problem in one of the planar spaces."""

    object: PlanarObject
    world: PlanarWorldSpec = PlanarWorldSpec()
    arms: Annotated[tuple[PlanarArm, ...], Field(min_length=1, max_length=_MOST_ARMS)]
