"""Self-motions with one degree of freedom as curves."""
