"""The pipeline's data as ROS 2 messages, and bags of them."""
