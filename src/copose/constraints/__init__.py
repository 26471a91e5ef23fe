"""Constraints of a posture: closure, torque limits, clearance."""
