"""Postures and motions in the formats of other programs."""

from copose.formats.registry import export, exported_text, trajectory_csv, usual_name
from copose.formats.ros import joint_trajectory_yaml

__all__ = ["export", "exported_text", "joint_trajectory_yaml", "trajectory_csv", "usual_name"]
