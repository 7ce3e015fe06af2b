"""Robots on a ROS 2 network, bags of an episode, and datasets as bags."""
