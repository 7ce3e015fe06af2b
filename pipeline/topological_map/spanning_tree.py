"""The minimum spanning tree without collisions (thesis 3.3)."""

from collections.abc import Callable, Iterable, Mapping

import networkx as nx
import numpy as np
from numpy.typing import NDArray

RAISED = 1e6
"""Weight, in m, that is added to an edge that cannot be driven."""


def collision_free_tree(
    positions: Mapping[int, NDArray[np.float64]],
    edges: Iterable[tuple[int, int]],
    is_free: Callable[[int, int], bool],
) -> nx.Graph:
    """Raise the weight of every tree edge that is not free, and span again, until all that can be free are.

    Args:
        positions: (3,) m of each node.
        edges: that come into question, at best those of the complete graph.
        is_free: whether no wall stands between two nodes.

    Returns:
        A tree for each group of nodes that free edges join, with the length of each edge as ``weight``.
    """
    graph = nx.Graph()
    graph.add_nodes_from(sorted(positions))
    for a, b in edges:
        graph.add_edge(a, b, weight=float(np.linalg.norm(positions[a] - positions[b])))
    while True:
        tree = nx.minimum_spanning_tree(graph)
        untested = [(a, b) for a, b, weight in tree.edges(data="weight") if weight < RAISED]
        blocked = [(a, b) for a, b in untested if not is_free(a, b)]
        if not blocked:
            tree.remove_edges_from([(a, b) for a, b, weight in tree.edges(data="weight") if weight >= RAISED])
            return tree
        for a, b in blocked:
            graph.edges[a, b]["weight"] += RAISED
