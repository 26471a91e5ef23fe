"""What is asked: a problem file as frozen, validated data."""

from copose.problem.aims import (
    AccelerationObjective,
    PayloadObjective,
    TaskCompatibilityObjective,
)
from copose.problem.arms import ArmSpec, PlanarArm, UrdfArm
from copose.problem.objects import PlanarObject, Shape, SpatialObject
from copose.problem.reading import load, moved, parse, read_text
from copose.problem.spaces import SPACES, Space, SpaceName
from copose.problem.spec import ConstraintsSpec, PlanarProblem, Problem, SpatialProblem

__all__ = [
    "SPACES",
    "AccelerationObjective",
    "ArmSpec",
    "ConstraintsSpec",
    "PayloadObjective",
    "PlanarArm",
    "PlanarObject",
    "PlanarProblem",
    "Problem",
    "Shape",
    "Space",
    "SpaceName",
    "SpatialObject",
    "SpatialProblem",
    "TaskCompatibilityObjective",
    "UrdfArm",
    "load",
    "moved",
    "parse",
    "read_text",
]
