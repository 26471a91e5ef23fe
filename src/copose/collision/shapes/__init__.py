"""Primitives, meshes and the solids that they are parts of."""
