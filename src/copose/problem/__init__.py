"""What is asked: a problem file as frozen, validated data."""

from copose.problem.aims import (
    AccelerationObjective,
    PayloadObjective,
    TaskCompatibilityObjective,
)
from copose.problem.arms import ArmSpec, PlanarArm, RobotArm
from copose.problem.cases import CaseSpec
from copose.problem.objects import (
    CapsuleShape,
    Obstacle,
    PlanarObject,
    PlanarObstacle,
    Shape,
    SpatialObject,
)
from copose.problem.overrides import aimed, overridden, read_override
from copose.problem.path import PathSpec, PlanarWaypoint, Waypoint
from copose.problem.reading import (
    case_problems,
    check_depth,
    displaced,
    is_planar,
    moved,
    parse,
    read_bytes,
    read_tables,
    read_text,
)
from copose.problem.spaces import SPACES, Space, SpaceName
from copose.problem.spec import SCHEMA, ConstraintsSpec, PlanarProblem, Problem, SpatialProblem

__all__ = [
    "SCHEMA",
    "SPACES",
    "AccelerationObjective",
    "ArmSpec",
    "CapsuleShape",
    "CaseSpec",
    "ConstraintsSpec",
    "Obstacle",
    "PathSpec",
    "PayloadObjective",
    "PlanarArm",
    "PlanarObject",
    "PlanarObstacle",
    "PlanarProblem",
    "PlanarWaypoint",
    "Problem",
    "RobotArm",
    "Shape",
    "Space",
    "SpaceName",
    "SpatialObject",
    "SpatialProblem",
    "TaskCompatibilityObjective",
    "Waypoint",
    "aimed",
    "case_problems",
    "check_depth",
    "displaced",
    "is_planar",
    "moved",
    "overridden",
    "parse",
    "read_bytes",
    "read_override",
    "read_tables",
    "read_text",
]
