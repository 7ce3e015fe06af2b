"""A labelled lidar on the robot: an addition to a run."""
