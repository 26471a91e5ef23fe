"""Roadmaps and dynamic programming over the arms' self-motions."""
