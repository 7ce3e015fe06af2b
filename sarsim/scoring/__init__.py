"""Scores of an episode against ground truth, which the robot never sees."""
