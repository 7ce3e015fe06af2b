"""The pipeline's data as ROS 2 messages, in bags and on networks with robots."""
