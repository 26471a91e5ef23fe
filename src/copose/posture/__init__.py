"""The best posture: the model, the posture program, the search, evaluation."""

from copose.posture.evaluation import evaluate, verify
from copose.posture.inspection import Check, check
from copose.posture.planner import Planner, solve

__all__ = ["Check", "Planner", "check", "evaluate", "solve", "verify"]
