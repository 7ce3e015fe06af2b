"""What the robot made of an episode, against the ground truth that it never saw."""
