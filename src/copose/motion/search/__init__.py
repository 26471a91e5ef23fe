"""The search for a motion: candidates, optimisation, refinement."""
