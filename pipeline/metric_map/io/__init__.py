"""The metric map as files: its own format, OctoMap, point clouds, and 2D maps for ROS and drawing programs."""
