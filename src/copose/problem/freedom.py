"""What may be moved beside the joints: offsets to the poses that the file gives, m and rad."""

from __future__ import annotations

from pydantic import AliasChoices, Field

from copose.problem.values import Interval, Spec


class Freedom(Spec):
    """How far something may be moved: coordinates that are not named stay."""

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """The free coordinates with their ranges, in the order of their fields."""
        given = ((name, getattr(self, name)) for name in type(self).model_fields)
        return {name: interval for name, interval in given if interval is not None}


class SpatialFreedom(Freedom):
    """``[object.freedom]``: offsets to position, world axes, and to roll, pitch, yaw."""

    x: Interval | None = None
    y: Interval | None = None
    z: Interval | None = None
    roll: Interval | None = None
    pitch: Interval | None = None
    yaw: Interval | None = None


class PlanarFreedom(Freedom):
    """``[object.freedom]`` in the plane."""

    x: Interval | None = None
    y: Interval | None = None
    angle: Interval | None = None


class BaseFreedom(Freedom):
    """``freedom.base``: offsets to an arm's base pose, world axes."""

    x: Interval | None = None
    y: Interval | None = None
    z: Interval | None = None
    yaw: Interval | None = None


class PlanarBaseFreedom(Freedom):
    """``freedom.base`` in the plane; ``angle`` and ``yaw`` are the same there."""

    x: Interval | None = None
    y: Interval | None = None
    yaw: Interval | None = Field(default=None, validation_alias=AliasChoices("angle", "yaw"))


class GraspFreedom(Freedom):
    """``freedom.grasp``: offsets to a grasp, object axes, and a turn about the tip's z axis."""

    x: Interval | None = None
    y: Interval | None = None
    z: Interval | None = None
    twist: Interval | None = None


class PlanarGraspFreedom(Freedom):
    """``freedom.grasp`` in the plane; ``angle`` and ``twist`` are the same there."""

    x: Interval | None = None
    y: Interval | None = None
    twist: Interval | None = Field(default=None, validation_alias=AliasChoices("angle", "twist"))


class ArmFreedom(Spec):
    """``[arms.freedom]``."""

    base: BaseFreedom = BaseFreedom()
    grasp: GraspFreedom = GraspFreedom()


class PlanarArmFreedom(Spec):
    """``[arms.freedom]`` in the plane."""

    base: PlanarBaseFreedom = PlanarBaseFreedom()
    grasp: PlanarGraspFreedom = PlanarGraspFreedom()
