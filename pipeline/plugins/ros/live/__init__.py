"""Robots on a ROS 2 network, real or simulated."""
