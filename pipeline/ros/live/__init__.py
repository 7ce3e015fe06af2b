"""Robots on a network of ROS 2, real or simulated."""
