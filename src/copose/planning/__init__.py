"""Objectives, constraints, the posture program, search."""

from copose.planning.checking import Check, check
from copose.planning.evaluating import evaluate, verify
from copose.planning.planner import Planner, solve

__all__ = ["Check", "Planner", "check", "evaluate", "solve", "verify"]
