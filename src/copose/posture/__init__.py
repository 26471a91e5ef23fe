"""The best posture: the model, the posture program, the search, evaluation."""

from copose.posture.planner import Planner, solve

__all__ = ["Planner", "solve"]
