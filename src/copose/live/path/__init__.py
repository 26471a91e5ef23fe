"""The motion along the path: planning, showing and playing it."""
