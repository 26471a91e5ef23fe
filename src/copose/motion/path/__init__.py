"""The object's path through the world and its instants."""
