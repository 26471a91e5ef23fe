"""The scene of the page, and the gizmos by which it is dragged."""
