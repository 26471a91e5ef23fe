"""Tables of a problem file that say what is wanted: the ellipsoid, the objective, the world."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, TypeAlias, get_args

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, WithJsonSchema

from copose.errors import shown
from copose.problem.fields import Direction, Number, Pair, Spec, Triple, fault, not_zero

if TYPE_CHECKING:
    from copose.problem.cases import CaseSpec
    from copose.problem.spec import Problem


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


class ObjectiveTable(Spec):
    """An objective of any kind, on a coordinate slice of the task space.

    Attributes:
        kind: what is maximised.
        axes: coordinates of the task space that count, such as x; the other accelerations are held
            at zero; left out, all count.
    """

    axes: tuple[str, ...] | None = None

    torque_limited: ClassVar[bool] = False
    """True where torque limits on every joint decide the value, and no unit ball."""
    kinematic: ClassVar[bool] = False
    """True where the value depends on no mass."""
    adds_coordinates: ClassVar[bool] = True
    """True where linear and angular coordinates are added up, so that the unit of length counts."""
    shares_load: ClassVar[bool] = False
    """True where a generalised inverse shares the load whatever the resolution."""
    directed: ClassVar[bool] = False
    """True where a case may give a direction of its own."""

    @property
    def wanted(self) -> tuple[tuple[float, ...], ...]:
        """Directions whose radii are told, as in the file."""
        return ()

    @property
    def pointed(self) -> tuple[tuple[float, ...], ...]:
        """Directions that a picture points along, as in the file."""
        return self.wanted

    @property
    def structure(self) -> Self:
        """This objective without the numbers that programs take as parameters."""
        return self

    def along(self, direction: tuple[float, ...]) -> Self:
        """This objective along one other direction, where it is `directed`."""
        return self.model_copy(update={"direction": direction})

    def check_axes(self) -> None:
        """Refuse axes, of which there are some, that the kind cannot have in any space."""

    def check(self, problem: Problem) -> None:
        """Refuse keys that do not fit each other or the problem; its axes are legal already."""

    def check_case(self, case: CaseSpec, key: str) -> None:
        """Refuse what a case changes to no effect."""


class VolumeObjective(ObjectiveTable):
    """The log-volume of the ellipsoid."""

    kind: Literal["volume"] = "volume"


class WorstDirectionObjective(ObjectiveTable):
    """The shortest semi-axis of the ellipsoid."""

    kind: Literal["worst-direction"]


class IsotropyObjective(ObjectiveTable):
    """Shortest over longest semi-axis of the ellipsoid."""

    kind: Literal["isotropy"]

    def check_axes(self) -> None:
        """More than one."""
        if self.axes is not None and len(self.axes) == 1:
            raise fault("objective.axes", "has one entry, whose isotropy is always 1; name more")


class WeightedDirection(Spec):
    """A task direction, and how much being fast (> 0) or fine (< 0) along it counts.

    Attributes:
        direction: task vector, linear over angular, of any length.
        weight: how much it counts, not 0.
    """

    direction: Direction
    weight: Annotated[Number, AfterValidator(not_zero)] = 1.0


class TaskCompatibilityObjective(ObjectiveTable):
    """Σ w log d(u) over directions u.

    Attributes:
        directions: directions along which the object is to be fast or fine.
    """

    kind: Literal["task-compatibility"]
    directions: Annotated[tuple[WeightedDirection, ...], Field(min_length=1, max_length=64)]

    directed = True

    @property
    def wanted(self) -> tuple[tuple[float, ...], ...]:
        """All of its directions."""
        return tuple(each.direction for each in self.directions)

    @property
    def structure(self) -> Self:
        """The number of its directions."""
        unit = WeightedDirection.model_construct(direction=(), weight=1.0)
        return self.model_copy(update={"directions": (unit,) * len(self.directions)})

    def along(self, direction: tuple[float, ...]) -> Self:
        """This objective along one direction, with weight 1."""
        return self.model_copy(update={"directions": (WeightedDirection(direction=direction),)})

    def check(self, problem: Problem) -> None:
        """Directions that fit the axes."""
        for i, direction in enumerate(self.wanted):
            problem.check_direction(direction, f"objective.directions[{i}].direction")


class VelocityVolumeObjective(ObjectiveTable):
    """The log-volume of the closed chain's velocity ellipsoid."""

    kind: Literal["velocity-volume"]

    kinematic, adds_coordinates = True, False


class ForceVolumeObjective(ObjectiveTable):
    """The log-volume of the ellipsoid of external wrenches, shared by W⁺."""

    kind: Literal["force-volume"]

    kinematic, adds_coordinates, shares_load = True, False, True


class PlainDirection(Spec):
    """A task direction.

    Attributes:
        direction: task vector, linear over angular, of any length.
    """

    direction: Direction


def _directions_schema() -> dict[str, Any]:
    """JSON Schema of directions as bare arrays or as tables."""
    array = {"type": "array", "items": {"type": "number"}}
    table = {
        "type": "object",
        "properties": {"direction": array},
        "required": ["direction"],
        "additionalProperties": False,
    }
    return {"type": "array", "minItems": 1, "maxItems": 16, "items": {"anyOf": [array, table]}}


def _as_directions(value: Any) -> Any:
    """Bare arrays stand for tables with a direction."""
    if not isinstance(value, tuple):
        return value
    return tuple({"direction": entry} if isinstance(entry, tuple) else entry for entry in value)


class AccelerationObjective(ObjectiveTable):
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
        WithJsonSchema(_directions_schema()),
    ] = None

    torque_limited = directed = True

    @property
    def wanted(self) -> tuple[tuple[float, ...], ...]:
        """Its directions, however they are given."""
        if self.direction is not None:
            return (self.direction,)
        return tuple(entry.direction for entry in self.directions or ())

    @property
    def structure(self) -> Self:
        """The coordinates that each direction has, on which its unit depends."""
        pattern = tuple(tuple(bool(x) for x in u) for u in self.wanted)
        return self.model_copy(update={"direction": pattern, "directions": None})

    def along(self, direction: tuple[float, ...]) -> Self:
        """This objective along one direction in place of one or several."""
        return self.model_copy(update={"direction": direction, "directions": None})

    def check(self, problem: Problem) -> None:
        """One direction or several, that fit the axes."""
        if (self.direction is None) == (self.directions is None):
            both = "one of direction and directions, not both, is"
            raise fault("objective.direction", f"{both} needed for acceleration")
        if self.direction is not None:
            problem.check_direction(self.direction, "objective.direction")
        for i, entry in enumerate(self.directions or ()):
            problem.check_direction(entry.direction, f"objective.directions[{i}].direction")


class PayloadObjective(ObjectiveTable):
    """The largest mass that can be held at rest, or accelerated along a direction.

    Attributes:
        acceleration: along the direction, m/s² or rad/s²; left out, the mass is held at rest.
        direction: task vector along which the mass is to be accelerated.
    """

    kind: Literal["payload"]
    acceleration: Number | None = None
    direction: Direction | None = None

    torque_limited = directed = True

    @property
    def pointed(self) -> tuple[tuple[float, ...], ...]:
        """The direction of the acceleration."""
        return () if self.direction is None else (self.direction,)

    @property
    def structure(self) -> Self:
        """Rest or motion."""
        given = self.direction is not None
        return self.model_copy(update={"direction": given, "acceleration": None})

    def check(self, problem: Problem) -> None:
        """Gravity, and neither or both of acceleration and direction."""
        given = "direction" if self.acceleration is None else "acceleration"
        missing = "acceleration" if given == "direction" else "direction"
        if (self.direction is None) != (self.acceleration is None):
            raise fault(
                f"objective.{missing}",
                f"missing; {given} beside it says how the mass is to be accelerated",
            )
        if self.direction is not None:
            problem.check_direction(self.direction, "objective.direction")
        if not any(problem.world.gravity):
            raise fault("world.gravity", "is 0; payload needs gravity")

    def check_case(self, case: CaseSpec, key: str) -> None:
        """No mass; a direction only beside an acceleration."""
        if case.mass is not None:
            raise fault(f"{key}.mass", "has no effect: objective 'payload' is about any mass")
        if case.direction is not None and self.acceleration is None:
            raise fault(f"{key}.direction", "needs acceleration in [objective] beside it")


class AllRoundObjective(ObjectiveTable):
    """The radius of the largest ball of accelerations around rest."""

    kind: Literal["all-round"]

    torque_limited = True

    def check(self, problem: Problem) -> None:
        """Axes of one kind."""
        space = problem.space
        if set(problem.axes) & set(space.linear) and set(problem.axes) & set(space.angular):
            raise fault(
                "objective.axes",
                "mixes linear and angular accelerations; all-round needs axes of one kind, "
                "such as " + str([space.coordinates[i] for i in space.linear]),
            )


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

OBJECTIVE_TABLES: dict[str, type[ObjectiveTable]] = {
    tag.tag: table for table, tag in map(get_args, get_args(get_args(ObjectiveSpec)[0]))
}
