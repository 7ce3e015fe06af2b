"""Topological map (thesis 3.3): nodes on the segments, traversable edges, and a minimum spanning tree."""
