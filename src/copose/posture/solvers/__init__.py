"""Newton steps under the closed chain, the nonlinear program of a posture, and IPOPT."""
