"""Exploration: the next best view and its baselines, goals, and the clock: what to do next."""
