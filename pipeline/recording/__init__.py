"""The recording: everything that the robot knows, step by step, in Rerun."""
