"""Semantic map (thesis 3.2): a class for every point, and the labelled points of all frames."""
