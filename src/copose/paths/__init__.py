"""Along a path: the best joint motion of arms that carry an object together."""

from copose.paths.making import Ends
from copose.paths.planner import PathPlanner, plan

__all__ = ["Ends", "PathPlanner", "plan"]
