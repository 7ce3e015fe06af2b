"""Readers of recordings, which are TUM folders or ROS bags."""
