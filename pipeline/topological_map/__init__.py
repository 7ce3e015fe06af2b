"""Topological map (thesis 3.3): nodes on segments, traversable edges, and a minimum spanning tree."""
