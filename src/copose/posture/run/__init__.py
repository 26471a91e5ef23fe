"""One answer: its acceptance and its evidence."""
