"""The things of a cell as nodes of a viser scene."""
