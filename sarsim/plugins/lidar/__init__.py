"""A labelled lidar on the robot, as a plug-in."""
