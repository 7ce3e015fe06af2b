"""Localisation: estimates the robot's pose in ``map``."""
