"""The pipeline's data as ROS 2 messages, bags of them, and robots on a network."""
