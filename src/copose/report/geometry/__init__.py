"""Geometry of what pictures show, as plain arrays."""
