"""The object, its shape, and placements in space and in the plane."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal, Self, TypeAlias

import numpy as np
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from copose.poses import Pose
from copose.problem.fields import Inertia, Name, Number, Pair, Positive, Quaternion, Spec, Triple
from copose.problem.freedom import PlanarFreedom, SpatialFreedom


class SolidShape(Spec):
    """A body by its measures; ``flat`` in the plane."""

    flat: ClassVar[bool] = False

    @property
    def measures(self) -> tuple[float, ...]:
        """All lengths that give the shape, in the order of its keys, m."""
        keys = [key for key in type(self).model_fields if key != "kind"]
        return tuple(np.hstack([getattr(self, key) for key in keys]).tolist())


class Box(SolidShape):
    """A box by its edge lengths, m.

    Attributes:
        kind: which shape.
        size: edge lengths, m.
    """

    kind: Literal["box"]
    size: tuple[Positive, Positive, Positive]


class Sphere(SolidShape):
    """A sphere.

    Attributes:
        kind: which shape.
        radius: its radius, m.
    """

    kind: Literal["sphere"]
    radius: Positive


class Cylinder(SolidShape):
    """A cylinder along z.

    Attributes:
        kind: which shape.
        radius: its radius, m.
        length: along z, m.
    """

    kind: Literal["cylinder"]
    radius: Positive
    length: Positive


class CapsuleShape(SolidShape):
    """All points within the radius of a segment along z, whose ends are ``length`` apart.

    Attributes:
        kind: which shape.
        radius: its radius, m.
        length: between the centres of its caps along z, m.
    """

    kind: Literal["capsule"]
    radius: Positive
    length: Positive


class Rectangle(SolidShape):
    """A planar box by its width and height, m.

    Attributes:
        kind: which shape.
        size: width and height, m.
    """

    kind: Literal["box"]
    size: tuple[Positive, Positive]
    flat: ClassVar[bool] = True


class Disk(SolidShape):
    """A disk.

    Attributes:
        kind: which shape.
        radius: its radius, m.
    """

    kind: Literal["disk"]
    radius: Positive
    flat: ClassVar[bool] = True


SpatialShape: TypeAlias = Annotated[Box | Sphere | Cylinder, Field(discriminator="kind")]
PlanarShape: TypeAlias = Annotated[Rectangle | Disk, Field(discriminator="kind")]
ObstacleShape: TypeAlias = Annotated[
    Box | Sphere | Cylinder | CapsuleShape, Field(discriminator="kind")
]
Shape: TypeAlias = Box | Sphere | Cylinder | Rectangle | Disk


class Oriented(Spec):
    """A table with an orientation in space; once read, ``rpy`` says it, however it was written.

    Attributes:
        rpy: roll, pitch, yaw about fixed axes as in a URDF, rad; left out of a case or waypoint, as
            it was.
        quaternion: [w, x, y, z] in place of rpy.
    """

    rpy: Triple | None = None
    quaternion: Quaternion | None = None

    @model_validator(mode="after")
    def _by_rpy(self) -> Self:
        if self.quaternion is not None:
            if "rpy" in self.model_fields_set:
                raise PydanticCustomError(
                    "copose", "rpy and quaternion exclude each other; leave out one of them"
                )
            pose = Pose.from_quaternion((0.0, 0.0, 0.0), self.quaternion)
            # Frozen from here on.
            self.__dict__.update(rpy=tuple(pose.rpy.tolist()), quaternion=None)
        return self


class SpatialObject(Oriented):
    """``[object]`` in space: pose of its centre of mass, mass, inertia about it.

    Attributes:
        mass: its mass, kg.
        inertia: about the centre of mass in object axes, kg·m²: 3 diagonal entries or 3×3; may be
            left out in spatial-linear alone.
        position: centre of mass in the world, m; may be left out where every grasp is taught:
            midway between the tips.
        shape: its body, drawn and tested for collision; left out, none.
        velocity: velocity of the object, linear over angular, m/s and rad/s; left out, at rest.
        freedom: how far copose may move the object.
    """

    mass: Positive
    inertia: Inertia | None = None
    position: Triple
    rpy: Triple = (0.0, 0.0, 0.0)
    shape: SpatialShape | None = None
    velocity: tuple[Number, ...] | None = None
    freedom: SpatialFreedom = SpatialFreedom()

    @property
    def pose(self) -> Pose:
        """Placement of the centre of mass in the world."""
        return Pose.from_rpy(self.position, self.rpy)

    def displaced(self, offsets: Mapping[str, float]) -> SpatialObject:
        """This object displaced by x, y, z, m, and roll, pitch, yaw, rad."""
        turns = zip(self.rpy, ("roll", "pitch", "yaw"), strict=True)
        rpy = tuple(angle + offsets.get(name, 0.0) for angle, name in turns)
        return self.model_copy(update={"position": _shifted(self.position, offsets), "rpy": rpy})


class PlanarObject(Spec):
    """``[object]`` in the plane.

    Attributes:
        mass: its mass, kg.
        inertia: about the centre of mass, kg·m²; may be left out in planar-linear alone.
        position: centre of mass in the world, m; may be left out where every grasp is taught:
            midway between the tips.
        angle: its angle, rad.
        shape: its body, drawn and tested for collision; left out, none.
        velocity: velocity of the object, linear over angular, m/s and rad/s; left out, at rest.
        freedom: how far copose may move the object.
    """

    mass: Positive
    inertia: Positive | None = None
    position: Pair
    angle: Number = 0.0
    shape: PlanarShape | None = None
    velocity: tuple[Number, ...] | None = None
    freedom: PlanarFreedom = PlanarFreedom()

    @property
    def pose(self) -> Pose:
        """Placement of the centre of mass in the world."""
        return _planar_pose(self.position, self.angle)

    def displaced(self, offsets: Mapping[str, float]) -> PlanarObject:
        """This object displaced by x, y, m, and yaw, rad."""
        angle = self.angle + offsets.get("yaw", 0.0)
        position = _shifted(self.position, offsets)
        return self.model_copy(update={"position": position, "angle": angle})


def _shifted(position: tuple[float, ...], offsets: Mapping[str, float]) -> tuple[float, ...]:
    return tuple(p + offsets.get(name, 0.0) for p, name in zip(position, "xyz", strict=False))


def _planar_pose(position: Pair, angle: float) -> Pose:
    return Pose.from_rpy((*position, 0.0), (0.0, 0.0, angle))


class Placement(Oriented):
    """Position and orientation of a frame in another.

    Attributes:
        position: its origin, m.
    """

    position: Triple = (0.0, 0.0, 0.0)
    rpy: Triple = (0.0, 0.0, 0.0)

    @property
    def pose(self) -> Pose:
        """The frame as a pose."""
        return Pose.from_rpy(self.position, self.rpy)


class PlanarPlacement(Spec):
    """Position and angle of a frame in another, in the plane.

    Attributes:
        position: its origin, m.
        angle: its angle, rad.
    """

    position: Pair = (0.0, 0.0)
    angle: Number = 0.0

    @property
    def pose(self) -> Pose:
        """The frame as a pose."""
        return _planar_pose(self.position, self.angle)


class Grasp(Placement):
    """Pose of the tip frame in the object frame."""

    position: Triple


class PlanarGrasp(PlanarPlacement):
    """Pose of the tip frame in the object frame, in the plane."""

    position: Pair


class Obstacle(Placement):
    """``[[obstacles]]``: a body that nothing may touch.

    Attributes:
        name: its name, which no other obstacle or arm has.
        shape: its body, centred at its position.
    """

    name: Name
    shape: ObstacleShape
    position: Triple


class PlanarObstacle(PlanarPlacement):
    """``[[obstacles]]`` in the plane.

    Attributes:
        name: its name, which no other obstacle or arm has.
        shape: its body, centred at its position.
    """

    name: Name
    shape: PlanarShape
    position: Pair
