"""Planning (thesis 3.4): the cheapest paths over poses, the path plan, and the order in which to visit goals."""
