"""What is asked: a problem file as frozen, validated data."""

from copose.problem.reading import load, parse, read_text
from copose.problem.spaces import SPACES, Space, SpaceName
from copose.problem.spec import (
    ArmSpec,
    PlanarArm,
    PlanarObject,
    PlanarProblem,
    Problem,
    Shape,
    SpatialObject,
    SpatialProblem,
    TaskCompatibilityObjective,
    UrdfArm,
)

__all__ = [
    "SPACES",
    "ArmSpec",
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
    "parse",
    "read_text",
]
