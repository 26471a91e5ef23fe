"""A problem made ready to compute with: numbers, expressions, limits, what is free."""
