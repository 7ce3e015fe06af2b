"""The minimum spanning tree without collisions (thesis 3.3)."""

import networkx as nx


def collision_free_tree(free: nx.Graph) -> nx.Graph:
    """The tree that the thesis's procedure ends with.

    The thesis spans the complete graph, adds a huge number to the weight of every edge of the tree that meets a
    wall, and spans again until none does. That ends with the minimum spanning tree of the edges that meet nothing,
    so where all edges are tested anyway, one pass over these is enough.

    Args:
        free: the nodes, and the edges that can be driven, with ``weight``.

    Returns:
        A tree for each group of nodes that free edges join, with the edges' data.
    """
    return nx.minimum_spanning_tree(free)
