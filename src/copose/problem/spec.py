"""A problem as frozen, validated data (SI units, radians): the tables of a problem file."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

from pydantic import (
    BeforeValidator,
    Field,
    PrivateAttr,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from copose.display import Displayed
from copose.errors import shown
from copose.problem.arms import ArmSpec, PlanarArm, RobotArm
from copose.problem.cases import Case, CaseSpec, PlanarCase
from copose.problem.fields import FolderName, NotNegative, Positive, Spec, Text, fault, whole
from copose.problem.objectives import (
    EllipsoidSpec,
    ObjectiveSpec,
    PlanarWorldSpec,
    VolumeObjective,
    WorldSpec,
)
from copose.problem.objects import Obstacle, PlanarObject, PlanarObstacle, SpatialObject
from copose.problem.path import PathSpec, PlanarPath, SpatialPath
from copose.problem.spaces import SPACES, Space, SpaceName

# JSON Schema of problem files; it is made from what follows.
SCHEMA = Path(__file__).with_name("schema.json")

Named: TypeAlias = ArmSpec | Obstacle | PlanarObstacle | CaseSpec


class Task(Spec):
    """``[task]``.

    Attributes:
        space: which components of motion and force count: rigid grasps, or in the linear spaces
            contacts that transmit forces alone.
    """

    space: SpaceName


class ConstraintsSpec(Spec):
    """``[constraints]``: what a posture must keep.

    Attributes:
        joint_margin: distance kept from every position limit, rad or m.
        static_torque: whether every torque must be within its limit while the object is held at
            rest.
        dynamic_torque: the same while it moves along a path; left out, only where the shortest
            duration is sought.
        internal_force: largest force of a contact against the others, N; left out, any.
        collision: whether bodies must keep apart.
        clearance: distance that they keep, m; it counts with collision.
    """

    joint_margin: NotNegative = 0.0
    static_torque: bool = False
    dynamic_torque: bool | None = None
    internal_force: Positive | None = None
    collision: bool = False
    clearance: NotNegative = 0.01


class SearchSpec(Spec):
    """``[search]``: how postures are searched.

    Attributes:
        seed: seed of everything random.
        reachable: whether only postures count that the arms can move to from the start without
            letting go.
    """

    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
    reachable: bool = False


class Problem(Displayed, Spec):
    """A problem file; `copose.load` reads one, `copose.parse` takes the same as a dict.

    Attributes:
        format: version of the file format, 1.
        name: name of the problem, and of the folder for its results.
        description: a text for the reader.
        task: the task space, which says how hands grasp.
        object: the object that the arms hold.
        arms: the arms, a table each.
        ellipsoid: which dynamic manipulability ellipsoid is meant.
        objective: what is maximised.
        world: gravity.
        constraints: what a posture must keep.
        obstacles: bodies that nothing may touch.
        cases: several tasks that one placement serves; left out, one task.
        path: the object's way, for `copose path`; left out, it stays.
        search: seed, and which postures count.
    """

    format: Annotated[Literal[1], BeforeValidator(whole)]
    name: FolderName
    description: Text = ""
    task: Task
    object: SpatialObject | PlanarObject
    arms: tuple[RobotArm, ...] | tuple[PlanarArm, ...]
    ellipsoid: EllipsoidSpec = EllipsoidSpec()
    objective: ObjectiveSpec = VolumeObjective()
    world: WorldSpec | PlanarWorldSpec = WorldSpec()
    constraints: ConstraintsSpec = ConstraintsSpec()
    obstacles: tuple[Obstacle | PlanarObstacle, ...] = ()
    cases: tuple[Case, ...] | tuple[PlanarCase, ...] = ()
    path: PathSpec | None = None
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

    @property
    def kinematic(self) -> bool:
        """True where what is asked for depends on no mass of an arm."""
        held, driven = self.constraints.static_torque, self.constraints.dynamic_torque
        if driven is None:
            # The shortest motion keeps whatever torque limits there are.
            driven = self.path is not None and self.path.duration == "shortest"
        return self.objective.kinematic and not (held or driven)

    @field_validator("arms", "obstacles", "cases", check_fields=False)
    @classmethod
    def _distinct(cls, named: tuple[Named, ...], info: ValidationInfo) -> tuple[Named, ...]:
        names = [each.name for each in named]
        for name in names:
            if names.count(name) > 1:
                raise PydanticCustomError(
                    "copose",
                    "two {what} are called {name}; give each its own",
                    {"name": repr(name), "what": info.field_name},
                )
        return named

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
            raise fault("object.velocity", f"has {len(velocity)} entries; {m} are needed")
        names = self.objective.axes
        if names is not None:
            self._check_axes(names)
        self.objective.check(self)
        for i, case in enumerate(self.cases):
            self._check_case(case, f"cases[{i}]")
        return self

    @model_validator(mode="after")
    def _places_make_sense(self) -> Problem:
        for i, arm in enumerate(self.arms):
            turns = arm.freedom.base.yaw is not None
            if turns and self.constraints.internal_force is not None:
                raise fault(
                    f"arms[{i}].freedom.base.yaw",
                    "and constraints.internal_force exclude each other; leave out one of them",
                )
        taken = {"object", *(arm.name for arm in self.arms)}
        for i, obstacle in enumerate(self.obstacles):
            if obstacle.name in taken:
                raise fault(
                    f"obstacles[{i}].name",
                    f"{shown(obstacle.name)} is the object's or an arm's; give it its own",
                )
        return self

    @model_validator(mode="after")
    def _path_fits(self) -> Problem:
        moves = bool(self.object.freedom.ranges) or any(
            arm.freedom.base.ranges or arm.freedom.grasp.ranges for arm in self.arms
        )
        if self.search.reachable and (moves or self.cases):
            also = "freedom" if moves else "cases"
            raise fault("search.reachable", f"and {also} exclude each other; leave out one of them")
        if self.path is None:
            return self
        if moves or self.cases:
            also = "freedom" if moves else "cases"
            raise fault("path", f"and {also} exclude each other; leave out one of them")
        for i, arm in enumerate(self.arms):
            if arm.fixed:
                raise fault(f"arms[{i}].fixed", "an arm held at its start cannot follow a path")
        return self

    def _check_case(self, case: CaseSpec, key: str) -> None:
        self.objective.check_case(case, key)
        if case.direction is None:
            return
        if not self.objective.directed:
            kind = self.objective.kind
            raise fault(f"{key}.direction", f"objective {kind!r} has no direction")
        if len(getattr(self.objective, "directions", None) or ()) > 1:
            raise fault(f"{key}.direction", "replaces one direction, but [objective] has several")
        self.check_direction(case.direction, f"{key}.direction")

    def _check_axes(self, names: tuple[str, ...]) -> None:
        legal = self.space.coordinates
        if not names:
            raise fault("objective.axes", f"is empty; allowed: {', '.join(legal)}")
        self.objective.check_axes()
        for i, name in enumerate(names):
            if name not in legal:
                raise fault(
                    f"objective.axes[{i}]",
                    f"{shown(name)} is no coordinate of space {self.task.space!r}; allowed: "
                    + ", ".join(legal),
                )
            if name in names[:i]:
                raise fault(f"objective.axes[{i}]", f"{shown(name)} is named twice")

    def check_direction(self, direction: tuple[float, ...], key: str) -> None:
        """Refuse a direction of the file that does not fit the axes."""
        m, a = self.space.m, len(self.axes)
        if len(direction) not in (m, a):
            sizes = f"{m}" if a == m else f"{m} or {a}"
            raise fault(key, f"has {len(direction)} entries; {sizes} are needed")
        if len(direction) == m and a < m:
            outside = [c for i, c in enumerate(self.space.coordinates) if i not in self.axes]
            if any(direction[self.space.coordinates.index(c)] != 0 for c in outside):
                raise fault(key, f"points outside axes: {', '.join(outside)} must be 0")

    def along(self, direction: tuple[float, ...]) -> tuple[float, ...]:
        """A direction of the file as a unit vector over ``axes``."""
        if len(direction) == self.space.m:
            direction = tuple(direction[i] for i in self.axes)
        norm = math.hypot(*direction)
        return tuple(x / norm for x in direction)

    @model_validator(mode="after")
    def _inertia_where_it_counts(self) -> Problem:
        if self.space.rigid and self.object.inertia is None:
            raise fault(
                "object.inertia", f"missing; space {self.task.space!r} needs the object's inertia"
            )
        return self


class SpatialProblem(Problem):
    """A problem in one of the spatial spaces."""

    object: SpatialObject
    world: WorldSpec = WorldSpec()
    arms: Annotated[tuple[RobotArm, ...], Field(min_length=1, max_length=32)]
    obstacles: Annotated[tuple[Obstacle, ...], Field(max_length=200)] = ()
    cases: Annotated[tuple[Case, ...], Field(max_length=16)] = ()
    path: SpatialPath | None = None


class PlanarProblem(Problem):
    """A problem in one of the planar spaces."""

    object: PlanarObject
    world: PlanarWorldSpec = PlanarWorldSpec()
    arms: Annotated[tuple[PlanarArm, ...], Field(min_length=1, max_length=32)]
    obstacles: Annotated[tuple[PlanarObstacle, ...], Field(max_length=200)] = ()
    cases: Annotated[tuple[PlanarCase, ...], Field(max_length=16)] = ()
    path: PlanarPath | None = None
