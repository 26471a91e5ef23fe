"""Freedom beside the joints: ranges of offsets to the poses that the file gives, m and rad."""

from __future__ import annotations

from pydantic import AliasChoices, Field

from copose.problem.fields import Interval, Spec


class FreedomRanges(Spec):
    """Ranges of free coordinates: those that are not named stay.

    Attributes:
        x: lowest and highest offset along x, m; left out, it stays.
        y: lowest and highest offset along y, m; left out, it stays.
        z: lowest and highest offset along z, m; left out, it stays.
        roll: lowest and highest offset to roll, rad; left out, it stays.
        pitch: lowest and highest offset to pitch, rad; left out, it stays.
        yaw: lowest and highest offset to yaw, rad; left out, it stays.
        angle: lowest and highest offset to angle, rad; left out, it stays.
        twist: lowest and highest turn about the tip's z axis, rad; left out, none.
    """

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """The free coordinates with their ranges, in the order of their fields."""
        given = ((name, getattr(self, name)) for name in type(self).model_fields)
        return {name: interval for name, interval in given if interval is not None}


class SpatialFreedom(FreedomRanges):
    """``[object.freedom]``: offsets to position, world axes, and to roll, pitch, yaw."""

    x: Interval | None = None
    y: Interval | None = None
    z: Interval | None = None
    roll: Interval | None = None
    pitch: Interval | None = None
    yaw: Interval | None = None


class PlanarFreedom(FreedomRanges):
    """``[object.freedom]`` in the plane."""

    x: Interval | None = None
    y: Interval | None = None
    angle: Interval | None = None


class BaseFreedom(FreedomRanges):
    """``[arms.freedom.base]``: offsets to the pose of an arm's base, world axes."""

    x: Interval | None = None
    y: Interval | None = None
    z: Interval | None = None
    yaw: Interval | None = None


class PlanarBaseFreedom(FreedomRanges):
    """``[arms.freedom.base]`` in the plane; ``angle`` and ``yaw`` are the same there."""

    x: Interval | None = None
    y: Interval | None = None
    yaw: Interval | None = Field(default=None, validation_alias=AliasChoices("angle", "yaw"))


class GraspFreedom(FreedomRanges):
    """``[arms.freedom.grasp]``: offsets to a grasp, object axes, and a turn about the tip's z."""

    x: Interval | None = None
    y: Interval | None = None
    z: Interval | None = None
    twist: Interval | None = None


class PlanarGraspFreedom(FreedomRanges):
    """``[arms.freedom.grasp]`` in the plane; ``angle`` and ``twist`` are the same there."""

    x: Interval | None = None
    y: Interval | None = None
    twist: Interval | None = Field(default=None, validation_alias=AliasChoices("angle", "twist"))


class ArmFreedom(Spec):
    """``[arms.freedom]``.

    Attributes:
        base: of the base, world axes.
        grasp: of the grasp, object axes.
    """

    base: BaseFreedom = BaseFreedom()
    grasp: GraspFreedom = GraspFreedom()


class PlanarArmFreedom(Spec):
    """``[arms.freedom]`` in the plane.

    Attributes:
        base: of the base, world axes.
        grasp: of the grasp, object axes.
    """

    base: PlanarBaseFreedom = PlanarBaseFreedom()
    grasp: PlanarGraspFreedom = PlanarGraspFreedom()
