"""What was recorded, to be mapped: TUM folders, ROS bags."""
