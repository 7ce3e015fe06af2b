"""Localisation: where the robot is in ``map``."""
