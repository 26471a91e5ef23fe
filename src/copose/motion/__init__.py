"""The best joint motion of arms that carry an object together along a path."""

from copose.motion.path.request import described
from copose.motion.planner import PathPlanner, plan
from copose.motion.search.candidates import Ends

__all__ = ["Ends", "PathPlanner", "described", "plan"]
