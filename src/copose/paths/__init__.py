"""Along a path: the best joint motion of arms that carry an object together."""

from copose.paths.asking import described
from copose.paths.planner import PathPlanner, plan
from copose.paths.trying import Ends

__all__ = ["Ends", "PathPlanner", "described", "plan"]
