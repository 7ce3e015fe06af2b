"""The graphs for plans: the spanning tree (thesis 3.3), and the roadmap with loops that shorten detours."""

import networkx as nx
import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import shortest_path


def collision_free_tree(free: nx.Graph) -> nx.Graph:
    """The minimum spanning tree of the edges that meet nothing, for each group of nodes that such edges join.

    The thesis spans the complete graph, adds a huge number to the weight of every edge of the tree that meets a
    wall, and spans again until none does. That ends with this tree, so where all edges are tested anyway, one pass
    over the free ones is enough.

    Args:
        free: the nodes, and the edges that can be driven, with ``weight``.
    """
    return nx.minimum_spanning_tree(free)


def roadmap(tree: nx.Graph, drives: nx.Graph, max_detour: float) -> nx.Graph:
    """The tree, and enough other drives that no way over the graph is over ``max_detour`` times the shortest one.

    A greedy spanner (Althöfer et al. 1993) that starts with the tree: drives come in order of their weight, and one
    is added if the present way between its ends is longer than ``max_detour`` times the drive.

    Args:
        tree: all the nodes, and some of the drives.
        drives: between these nodes, with ``weight``.
        max_detour: at least 1.
    """
    graph = tree.copy()
    row = {n: k for k, n in enumerate(graph)}
    way = shortest_path(nx.to_scipy_sparse_array(graph, dtype=float))
    for a, b, data in sorted(drives.edges(data=True), key=lambda d: (d[2]["weight"], *sorted(d[:2]))):
        if way[row[a], row[b]] > max_detour * data["weight"]:
            graph.add_edge(a, b, **data)
            _open(way, row[a], row[b], data["weight"])
    return graph


def _open(way: NDArray[np.float64], i: int, j: int, weight: float) -> None:
    """Update the lengths of all shortest ways (N, N) for a new edge between i and j."""
    through = way[:, i, None] + (way[j] + weight)
    np.minimum(way, np.minimum(through, through.T), out=way)
