"""The null space of one arm while it holds the object: its self-motions."""
