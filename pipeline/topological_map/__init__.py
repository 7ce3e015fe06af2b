"""Topological map (thesis 3.3): nodes on the segments, drivable edges, a minimum spanning tree."""
