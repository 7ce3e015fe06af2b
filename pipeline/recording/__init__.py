"""What the robot knows, step by step, in Rerun; recordings of cameras to map; ROS bags and robots on ROS networks."""
