"""Exploration: the next best view, its baselines, and what a view should show."""
