"""Gazebo worlds: SDF files that are read as arenas."""
