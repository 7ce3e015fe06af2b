"""Segments (thesis 3.2): planes by region growing and RANSAC, and their bounding boxes."""
