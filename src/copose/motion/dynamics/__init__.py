"""Rates, torques and limits along a motion."""
