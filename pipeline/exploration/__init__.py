"""Exploration: the choice of the next viewpoint, by the next best view or a baseline, with goals and a clock."""
