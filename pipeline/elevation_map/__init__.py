"""Elevation map: how high the ground is, and where the robot may drive on it."""
