"""Slices of self-motions: every posture of an arm that holds the object, one joint locked."""
