"""Curves between knots: differences, Hermite interpolation, distances between knots."""
