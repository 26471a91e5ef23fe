"""The root of all records, and those of ellipsoids and of what torque limits allow."""

from __future__ import annotations

from typing import Annotated, TypeAlias

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from copose.capability import Ellipsoid
from copose.poses import Array

Finite: TypeAlias = Annotated[float, Field(allow_inf_nan=False)]
Vector: TypeAlias = tuple[Finite, ...]
Matrix: TypeAlias = tuple[Vector, ...]


def vector(values: Array) -> Vector:
    """An array as a tuple of floats."""
    return tuple(np.asarray(values, dtype=float).tolist())


def matrix(values: Array) -> Matrix:
    """An array of two dimensions as a tuple of rows."""
    return tuple(map(tuple, np.asarray(values, dtype=float).tolist()))


class Record(BaseModel):
    """The root of every part of a result: frozen, finite, no unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)


class EllipsoidRecord(Record):
    """An ellipsoid's numbers, or nulls where the posture has none."""

    gram: Matrix | None
    center: Vector | None
    radii: Vector | None
    axes: Matrix | None
    log_volume: Finite | None

    @classmethod
    def of(cls, ellipsoid: Ellipsoid | None) -> EllipsoidRecord:
        """The record of an ellipsoid, or of the lack of one."""
        if ellipsoid is None:
            return cls(gram=None, center=None, radii=None, axes=None, log_volume=None)
        return cls(
            gram=matrix(ellipsoid.gram),
            center=vector(ellipsoid.center),
            radii=vector(ellipsoid.radii),
            axes=matrix(ellipsoid.axes),
            log_volume=ellipsoid.log_volume,
        )

    @property
    def value(self) -> Ellipsoid | None:
        """The ellipsoid itself."""
        if self.radii is None or self.axes is None or self.center is None:
            return None
        factor = np.array(self.axes) / np.array(self.radii)[:, None]
        return Ellipsoid.from_factor(factor, self.center)


class CompanionRecord(EllipsoidRecord):
    """An ellipsoid of velocities or forces.

    Attributes:
        along: how far it reaches along each of its coordinates, (uᵀG u)^(−1/2), and then along each
            direction that the objective names; null where there is no ellipsoid.
    """

    along: Vector | None

    @classmethod
    def of_directions(cls, ellipsoid: Ellipsoid | None, directions: Array) -> CompanionRecord:
        """The record of an ellipsoid with its radii along some directions, (k, a)."""
        along = None if ellipsoid is None else [ellipsoid.radius(u) for u in directions]
        numbers = EllipsoidRecord.of(ellipsoid).model_dump()
        return cls(**numbers, along=None if along is None else tuple(along))


class WrenchRecord(Record):
    """A contact wrench, tip on object, at the tip in world axes, N and N·m.

    Attributes:
        wrench: h_i, (m,).
        internal: its part that does nothing to the object, ((I − W⁺W)h)_i with the nonsqueezing W⁺.
    """

    wrench: Vector
    internal: Vector


class AccelerationRecord(Record):
    """Largest acceleration of the object along a direction, all other accelerations zero.

    Attributes:
        direction: unit, over all coordinates of the task.
        value: m/s², or rad/s² along an angular direction; null where none is possible.
    """

    direction: Vector
    value: Finite | None


class ExactSetRecord(Record):
    """The exact set of accelerations on some axes, others zero.

    Attributes:
        axes: coordinates.
        vertices: its corners; none where the limits allow no such acceleration.
        residual_radius: of the largest ball around rest in it, 0 where rest is not inside.
        ellipsoid: its part that torques reach whose shares of their limits have squares that add
            up to at most 1; nulls where there is none.
    """

    axes: tuple[str, ...]
    vertices: Matrix
    residual_radius: Finite
    ellipsoid: EllipsoidRecord
