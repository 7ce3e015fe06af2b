"""The roadmap: the spanning tree and those loops that shorten detours."""

import networkx as nx
import numpy as np


def roadmap(free: nx.Graph, max_detour: float) -> nx.Graph:
    """The greedy spanner of a graph: no way over it is longer than ``max_detour`` times the shortest one.

    Edges come in order of their weight, and one stays if the way between its ends over those that stayed before is
    longer than ``max_detour`` times its own (Althöfer et al. 1993). So it holds a minimum spanning tree.

    Args:
        free: edges that can be driven, with ``weight``.
        max_detour: at least 1.
    """
    graph = nx.Graph()
    graph.add_nodes_from(sorted(free))
    row = {n: k for k, n in enumerate(graph)}
    way = np.where(np.eye(len(row), dtype=bool), 0.0, np.inf)
    for a, b, data in sorted(free.edges(data=True), key=lambda edge: (edge[2]["weight"], *sorted(edge[:2]))):
        i, j, weight = row[a], row[b], data["weight"]
        if way[i, j] > max_detour * weight:
            graph.add_edge(a, b, **data)
            through = np.minimum(way[:, [i]] + way[[j]], way[:, [j]] + way[[i]]) + weight
            np.minimum(way, through, out=way)
    return graph
