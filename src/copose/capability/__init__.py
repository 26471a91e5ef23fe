"""Capability of torques: ellipsoids as expressions and as values, extremes within limits."""

from copose.capability.companions import ClosedChainVelocity, ExternalForce
from copose.capability.ellipsoid import Ellipsoid, log_ball_volume
from copose.capability.exact_set import ExactSet
from copose.capability.reach import HoldingTorque, TorqueReach
from copose.capability.sums import Form, Sums, symmetric, upper_triangle
from copose.capability.torque_maps import (
    RESOLUTIONS,
    Resolution,
    forward_dynamics,
    log_det,
    torque_map,
)

__all__ = [
    "RESOLUTIONS",
    "ClosedChainVelocity",
    "Ellipsoid",
    "ExactSet",
    "ExternalForce",
    "Form",
    "HoldingTorque",
    "Resolution",
    "Sums",
    "TorqueReach",
    "forward_dynamics",
    "log_ball_volume",
    "log_det",
    "symmetric",
    "torque_map",
    "upper_triangle",
]
