"""Objectives: what is maximised, each in a file of its own."""
