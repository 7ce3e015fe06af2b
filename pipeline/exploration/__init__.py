"""Exploration: the next best view, its baselines, and what a viewpoint should show."""
