"""What torques can do: A_o and the Ellipsoid value."""

from copose.capability.ellipsoid import Ellipsoid, log_ball_volume
from copose.capability.manipulability import gram, log_det, own_torque_map, torque_maps

__all__ = ["Ellipsoid", "gram", "log_ball_volume", "log_det", "own_torque_map", "torque_maps"]
