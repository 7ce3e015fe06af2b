"""Readers of recordings to be mapped: TUM folders and ROS bags."""
