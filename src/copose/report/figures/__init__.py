"""Whole pictures of results, and their files."""
