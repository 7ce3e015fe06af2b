"""The metric map as files: its own, OctoMap's, point clouds and 2D maps for ROS."""
