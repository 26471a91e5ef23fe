"""The links of robots as solids, by whatever file the robot is read from."""
