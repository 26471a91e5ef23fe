"""Postures drawn in the plane and in space."""
