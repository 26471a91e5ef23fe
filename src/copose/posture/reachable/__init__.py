"""Postures that arms can reach without letting go."""
