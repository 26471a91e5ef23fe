"""The search where more than joints is free."""
