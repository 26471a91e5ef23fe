"""Objectives, constraints, the posture program, search."""

from copose.planning.checking import Check, check
from copose.planning.evaluating import evaluate, verify
from copose.planning.solving import solve

__all__ = ["Check", "check", "evaluate", "solve", "verify"]
