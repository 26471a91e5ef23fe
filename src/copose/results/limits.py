"""Records of what torque limits allow."""

from __future__ import annotations

from copose.results.records import EllipsoidRecord, Finite, Matrix, Record, Vector


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
