"""Robot files as trees of links and joints: URDF, xacro and MuJoCo models."""
