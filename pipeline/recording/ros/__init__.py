"""What the pipeline knows as ROS 2 messages, and bags of them."""
