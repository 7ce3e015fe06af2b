"""The graphs used for planning: the spanning tree (thesis 3.3), and the roadmap, whose loops shorten detours."""

import networkx as nx
import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import shortest_path


def collision_free_tree(free: nx.Graph) -> nx.Graph:
    """The minimum spanning tree of the edges that meet no obstacle, one for each group of nodes that they connect.

    The thesis computes the tree of the complete graph, adds a huge number to the weight of each of its edges that
    meets a wall, and repeats this until none does. This ends with the same tree. Because all edges are tested anyway,
    one pass over the free ones is enough.

    Args:
        free: graph of all nodes and of the edges that can be driven, with ``weight``.
    """
    return nx.minimum_spanning_tree(free)


def roadmap(tree: nx.Graph, drives: nx.Graph, max_detour: float) -> nx.Graph:
    """The tree, and enough other drives that no path is longer than ``max_detour`` times that over all drives.

    A greedy spanner (Althöfer et al. 1993) that starts with the tree: drives are considered in order of their weight,
    and a drive is added if the current path between its ends is longer than ``max_detour`` times the drive.

    Args:
        tree: graph of all nodes and some of the drives.
        drives: graph of all drives between these nodes, with ``weight``.
        max_detour: maximum ratio of the lengths, at least 1.
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
    """Update the lengths (N, N) of all shortest paths for a new edge between i and j."""
    through = way[:, i, None] + (way[j] + weight)
    np.minimum(way, np.minimum(through, through.T), out=way)
