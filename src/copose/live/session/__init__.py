"""The problem on the page: its posture, its self-motions and its motion, and changes and undo."""
