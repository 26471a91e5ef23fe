"""What torques can do: the two ellipsoids of a system as expressions, and the Ellipsoid value."""

from copose.capability.ellipsoid import Ellipsoid, log_ball_volume
from copose.capability.resolutions import (
    RESOLUTIONS,
    Resolution,
    log_det,
    own_torque_map,
    torque_map,
    zero_torque_acceleration,
)

__all__ = [
    "RESOLUTIONS",
    "Ellipsoid",
    "Resolution",
    "log_ball_volume",
    "log_det",
    "own_torque_map",
    "torque_map",
    "zero_torque_acceleration",
]
