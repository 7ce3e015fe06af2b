"""Elevation map: the height of the ground, and where the robot may drive on it."""
