"""A study on the page: its points in the scene and in a panel, and a choice among them."""
