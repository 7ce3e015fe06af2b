"""Paths with bends between neighbouring nodes that no straight drive joins, updated where the ground changes."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import networkx as nx
import numpy as np

from pipeline.arrays import Cells, MaskLayer, Place
from pipeline.elevation_map.traversability import Traversability
from pipeline.grid_map import box_around
from pipeline.planning.pose_paths import PosePaths, simplify
from pipeline.topological_map.node_set import Node, StraightDrives, drive_seconds


class Passages:
    """The cheapest paths between nodes whose regions touch; a cell belongs to the region of the nearest node."""

    def __init__(self, sight: float) -> None:
        """``sight``: maximum distance at which a node sees ground, m."""
        self._sight = sight
        self._edges: dict[tuple[int, int], dict[str, Any]] = {}
        self._nodes: dict[int, Node] = {}

    def renew(self, nodes: Mapping[int, Node], links: StraightDrives, drives: nx.Graph, changed: MaskLayer) -> None:
        """Search again for passages around ``changed`` ground and nodes that were added, removed or moved.

        Nodes joined by straight ``drives`` have no passages between them.
        """
        grid = links.traversability.grid
        before = self._nodes
        self._nodes = dict(nodes)
        pairs = (before, nodes), (nodes, before)
        moved = [some[n].position for some, other in pairs for n in some if some[n] is not other.get(n)]
        mask = changed | grid.mask_of(np.array(moved).reshape(-1, 3))
        if not mask.any():
            return
        # Nodes see no ground beyond their sight, so all nodes whose regions changed are in this box.
        part = links.traversability.part(box_around(mask, round(self._sight / grid.cell)))
        here = {n: node for n, node in nodes.items() if part.grid.holds(part.grid.cell_of(node.position))}
        kept = {pair: edge for pair, edge in self._edges.items() if all(nodes.get(n) is before[n] for n in pair)}
        self._edges = _free_edges(kept, nodes, links) | _edges_between(here, links, drives, part)

    def add_to(self, drives: nx.Graph) -> None:
        """Add the passages between nodes that no straight drive joins to a graph of straight drives.

        Each edge stores the ``bends`` of its path, (M, 3) m, from the node with the lower id to the other node.
        """
        drives.add_edges_from((a, b, edge) for (a, b), edge in self._edges.items() if not drives.has_edge(a, b))


def _free_edges(
    edges: Mapping[tuple[int, int], dict[str, Any]], nodes: Mapping[int, Node], links: StraightDrives
) -> dict[tuple[int, int], dict[str, Any]]:
    """The edges whose paths are still free of obstacles."""
    ways = [np.vstack([nodes[a].position, edge["bends"], nodes[b].position]) for (a, b), edge in edges.items()]
    legs = np.array([leg for way in ways for leg in pairwise(way)]).reshape(-1, 2, 3)
    of_leg = np.repeat(np.arange(len(ways)), [len(way) - 1 for way in ways])
    blocked = of_leg[~links.are_free(legs[:, 0], legs[:, 1])]
    return {pair: edge for k, (pair, edge) in enumerate(edges.items()) if k not in blocked}


def _edges_between(
    nodes: Mapping[int, Node], links: StraightDrives, drives: nx.Graph, part: Traversability
) -> dict[tuple[int, int], dict[str, Any]]:
    """The edges of passages between nodes on a part of the ground, by the lower and the higher node id."""
    edges: dict[tuple[int, int], dict[str, Any]] = {}
    if len(nodes) < 2:
        return edges
    paths = PosePaths(part, [nodes[n].position for n in sorted(nodes)])
    for p, q in _border_crossings(paths):
        there, back = (paths.path_to(part.grid.centre_of(cell)) for cell in (p, q))
        a, b = (_nearest_node(nodes, way[0]) for way in (there, back))
        if a > b:
            a, b, there, back = b, a, back, there
        if a == b or drives.has_edge(a, b):
            continue
        way = simplify(np.vstack([there, back[::-1]]), links.traversability)
        inner = links.traversability.on_ground(way[1:-1])
        points = np.vstack([nodes[a].position, inner, nodes[b].position])
        if links.are_free(points[:-1], points[1:]).all():
            length = float(np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1).sum())
            seconds = float(drive_seconds(links.traversability, points[:-1], points[1:]).sum())
            edges[a, b] = {"weight": seconds, "length": length, "bends": inner}
    return edges


def _nearest_node(nodes: Mapping[int, Node], xy: Place) -> int:
    """The id of the node nearest to a position (2,), m."""
    return min(nodes, key=lambda n: float(np.linalg.norm(nodes[n].position[:2] - xy)))


def _border_crossings(paths: PosePaths) -> list[tuple[Cells, Cells]]:
    """For each pair of touching regions, the two cells where the cheapest path between the nodes crosses over."""
    source = paths.sources()
    cells = []
    costs = []
    keys = []
    for step in ((1, 0), (0, 1)):
        here = tuple(slice(None, -1) if s else slice(None) for s in step)
        there = tuple(slice(1, None) if s else slice(None) for s in step)
        a, b = source[here], source[there]
        border = (a != b) & (a >= 0) & (b >= 0)
        p = np.argwhere(border)
        cells.append(np.stack([p, p + step], axis=1))
        costs.append((paths.cost[here] + paths.cost[there])[border])
        keys.append(np.sort(np.stack([a[border], b[border]], axis=1), axis=1))
    pairs = np.concatenate(cells)
    order = np.argsort(np.concatenate(costs), kind="stable")
    _, first = np.unique(np.concatenate(keys)[order], axis=0, return_index=True)
    return [(pairs[k, 0], pairs[k, 1]) for k in order[np.sort(first)]]
