"""The surface layer of the metric map: how high the ground is, where the robot may drive, the shortest ways."""
