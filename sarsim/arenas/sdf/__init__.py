"""Gazebo's worlds: SDF files read as arenas."""
