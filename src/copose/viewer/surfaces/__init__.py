"""Surfaces of triangles as a page draws them."""
