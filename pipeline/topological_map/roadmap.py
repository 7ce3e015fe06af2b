"""The graphs for plans: the spanning tree (thesis 3.3), and the roadmap with loops that shorten detours."""

from collections.abc import Mapping

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from pipeline.topological_map.links import Links, drive_seconds
from pipeline.topological_map.node_set import Node
from pipeline.traversability.pose_paths import PosePaths, simplify


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
    """The tree, and as many more drives as no way over the graph needs to be ``max_detour`` times the shortest one.

    A greedy spanner (Althöfer et al. 1993) that begins with the tree: drives come in order of their weight, and one
    is added if the way between its ends so far is longer than ``max_detour`` times its own.

    Args:
        tree: all the nodes, and some of the drives.
        drives: between these nodes, with ``weight``.
        max_detour: at least 1.
    """
    graph = tree.copy()
    row = {n: k for k, n in enumerate(graph)}
    way = np.where(np.eye(len(row), dtype=bool), 0.0, np.inf)
    for a, b, weight in graph.edges(data="weight"):
        _open(way, row[a], row[b], weight)
    for a, b, data in sorted(drives.edges(data=True), key=lambda d: (d[2]["weight"], *sorted(d[:2]))):
        if way[row[a], row[b]] > max_detour * data["weight"]:
            graph.add_edge(a, b, **data)
            _open(way, row[a], row[b], data["weight"])
    return graph


def _open(way: NDArray[np.float64], i: int, j: int, weight: float) -> None:
    """Let all ways (N, N) use a new edge between i and j."""
    through = np.minimum(way[:, [i]] + way[[j]], way[:, [j]] + way[[i]]) + weight
    np.minimum(way, through, out=way)


def add_passages(drives: nx.Graph, nodes: Mapping[int, Node], links: Links) -> None:
    """Join neighbours that no straight drive joins by the shortest way between them.

    Neighbours are nodes whose shares of the ground touch, each cell being the share of the node nearest to it by
    drive. The edge keeps the ``bends`` of its way: (M, 3) m, from the node of the lower id to the other.
    """
    traversability = links.traversability
    paths = PosePaths(traversability, [nodes[n].position for n in sorted(nodes)])
    for p, q in _meetings(paths):
        there, back = (paths.path_to(traversability.grid.centre_of(cell)) for cell in (p, q))
        a, b = (_nearest(nodes, way[0]) for way in (there, back))
        if a == b or drives.has_edge(a, b):
            continue
        way = simplify(np.vstack([there, back[::-1]]), traversability)
        points = np.vstack([nodes[a].position, traversability.on_ground(way[1:-1]), nodes[b].position])
        if links.are_free(points[:-1], points[1:]).all():
            length = float(np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1).sum())
            seconds = float(drive_seconds(traversability, points[:-1], points[1:]).sum())
            bends = points[1:-1] if a < b else points[-2:0:-1]
            drives.add_edge(a, b, weight=seconds, length=length, bends=bends)


def _nearest(nodes: Mapping[int, Node], xy: NDArray[np.float64]) -> int:
    return min(nodes, key=lambda n: float(np.linalg.norm(nodes[n].position[:2] - xy)))


def _meetings(paths: PosePaths) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Of every two touching shares the two neighbouring cells (2,) where the way between their nodes is shortest."""
    source = paths.sources()
    cells, costs, keys = [], [], []
    for step in ((1, 0), (0, 1)):
        here = tuple(slice(None, -1) if s else slice(None) for s in step)
        there = tuple(slice(1, None) if s else slice(None) for s in step)
        a, b = source[here], source[there]
        border = (a != b) & (a >= 0) & (b >= 0)
        p = np.argwhere(border)
        cells.append(np.stack([p, p + step], axis=1))
        costs.append((paths.cost[here] + paths.cost[there])[border])
        keys.append(np.sort(np.stack([a[border], b[border]], axis=1), axis=1))
    pairs, cost = np.concatenate(cells), np.concatenate(costs)
    order = np.argsort(cost, kind="stable")
    _, first = np.unique(np.concatenate(keys)[order], axis=0, return_index=True)
    return [(pairs[k, 0], pairs[k, 1]) for k in order[np.sort(first)]]
