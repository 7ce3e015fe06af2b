"""Rescue arenas: the worlds that the robot explores."""
