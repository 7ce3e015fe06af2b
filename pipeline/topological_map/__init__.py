"""Topological map (thesis 3.3): nodes on the segments, edges that a robot can drive, a minimum spanning tree."""
