"""Readers of recordings that are to be mapped: TUM folders and ROS bags."""
