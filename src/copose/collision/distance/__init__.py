"""Distances and collision tests of bodies in many configurations."""
