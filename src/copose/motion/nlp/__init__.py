"""The nonlinear program over all knots of a motion."""
