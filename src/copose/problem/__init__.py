"""Problems: what is asked, a problem file as frozen, validated data."""

from copose.problem.arms import ArmSpec, PlanarArm, RobotArm
from copose.problem.file.overrides import aimed, overridden, read_override
from copose.problem.file.reading import (
    check_depth,
    is_planar,
    is_study,
    moved,
    parse,
    placement,
    read_bytes,
    read_tables,
    read_text,
    tables_in,
)
from copose.problem.objectives import OBJECTIVE_TABLES
from copose.problem.objects import CapsuleShape, Obstacle, PlanarObject, PlanarObstacle, Shape
from copose.problem.path import PathSpec, PlanarWaypoint, Waypoint
from copose.problem.spaces import SPACES, Space, SpaceName
from copose.problem.spec import SCHEMA, ConstraintsSpec, Problem
from copose.problem.variants import case_problems, changed, displaced, held, same_structure

__all__ = [
    "OBJECTIVE_TABLES",
    "SCHEMA",
    "SPACES",
    "ArmSpec",
    "CapsuleShape",
    "ConstraintsSpec",
    "Obstacle",
    "PathSpec",
    "PlanarArm",
    "PlanarObject",
    "PlanarObstacle",
    "PlanarWaypoint",
    "Problem",
    "RobotArm",
    "Shape",
    "Space",
    "SpaceName",
    "Waypoint",
    "aimed",
    "case_problems",
    "changed",
    "check_depth",
    "displaced",
    "held",
    "is_planar",
    "is_study",
    "moved",
    "overridden",
    "parse",
    "placement",
    "read_bytes",
    "read_override",
    "read_tables",
    "read_text",
    "same_structure",
    "tables_in",
]
