"""Planning (thesis 3.4): shortest paths, the path plan, and the order of several goals."""
