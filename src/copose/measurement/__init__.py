"""The numbers of one posture as a result states them."""
