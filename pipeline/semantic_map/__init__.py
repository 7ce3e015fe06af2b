"""Semantic map (thesis 3.2): a class for every point, and the planes and bounding boxes found in them."""
