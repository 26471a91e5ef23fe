"""Each arm as plain numbers: joints, placements, inertias, limits."""

from copose.robots.arm import Arm, ArmStart, Joint, finite_range, freed
from copose.robots.problem_arms import load_arms

__all__ = ["Arm", "ArmStart", "Joint", "finite_range", "freed", "load_arms"]
