"""Exploration: what the robot does next, by the next best view or a baseline, with goals and a clock."""
