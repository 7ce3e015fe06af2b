"""What the robot knows, step by step, in Rerun."""
