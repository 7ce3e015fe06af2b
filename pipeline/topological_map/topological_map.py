"""The topological map (thesis 3.3): few nodes that together see all the ground, and drives between them."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

import networkx as nx
import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import shortest_path

from pipeline.arrays import Mask, MaskLayer, Place, Places, Poses
from pipeline.elevation_map.traversability import Traversability
from pipeline.files import atomic_write
from pipeline.keyframes import AnchoredPlaces
from pipeline.labels import Label
from pipeline.planning.pose_paths import PosePaths
from pipeline.segments.planes import PlanePatch
from pipeline.segments.segments import Segments
from pipeline.topological_map.config import TopologicalMapConfig
from pipeline.topological_map.node_set import Node, NodeSet, drive_seconds
from pipeline.topological_map.passages import Passages
from pipeline.topological_map.placement import Placement, thesis_places

GraphKind = Literal["mst", "roadmap"]
"""The graph used for planning: the thesis's minimum spanning tree, or this tree and edges that shorten detours."""


class TopologicalMap:
    """Nodes and edges, updated in each step where the ground has changed.

    Attributes:
        kind: kind of the graph used for planning.
        tree: the minimum spanning tree, a networkx graph of node ids with ``weight``, s, and ``length``, m.
        graph: the graph used for planning: the tree itself, or the roadmap, whose other edges may have ``bends``.
    """

    def __init__(self, graph: GraphKind = "roadmap", *, config: TopologicalMapConfig = TopologicalMapConfig()):
        self._config = config
        self.kind: GraphKind = graph
        self.tree = self.graph = nx.Graph()
        self._node_set = NodeSet(config)
        self._passages = Passages(config.sight)
        self._places = AnchoredPlaces.joined([])
        self._bends = dict[tuple[int, int], AnchoredPlaces]()

    @property
    def nodes(self) -> Mapping[int, Node]:
        """The nodes by id."""
        return self._node_set.nodes

    def update(self, patches: Sequence[PlanePatch], segments: Segments, paths: PosePaths) -> None:
        """Update the map with a keyframe.

        Args:
            patches: the planes of this keyframe; a terrain patch may get a node at its centre.
            segments: all segments so far.
            paths: cheapest paths over the ground from the robot's pose.
        """
        # Adapt the nodes to the ground where it changed.
        nodes = self._node_set
        changed = nodes.renew(paths.traversability, self._reachable(paths), segments.of(Label.WALL))
        # Place nodes by the thesis's rules, then for ground that no node sees, then to connect groups, and thin
        # them out.
        places = thesis_places(patches, segments, nodes.cover, self._config)
        placement = Placement(nodes, places, segments, self._config)
        old = set(nodes.nodes)
        placement.add_places()
        placement.cover_rest()
        placement.join()
        placement.thin_out({n for n in nodes.nodes if n not in old or nodes.cover.is_near(n, changed)})
        # Choose the drives along which paths are planned.
        self.tree = collision_free_tree(nodes.drive_graph)
        self.graph = self.tree
        if self.kind == "roadmap" and len(nodes.nodes) > 1:
            drives = nodes.drive_graph.copy()
            self._passages.renew(nodes.nodes, nodes.straight_drives, nodes.drive_graph, changed)
            self._passages.add_to(drives)
            self.graph = roadmap(self.tree, drives, self._config.max_detour)

    def anchor(self, poses: Poses) -> None:
        """Anchor the nodes and the bends of edges to the keyframes nearest to them."""
        positions = np.array([node.position for node in self.nodes.values()]).reshape(-1, 3)
        self._places = AnchoredPlaces.anchored(positions, poses)
        self._bends = {
            (a, b): AnchoredPlaces.anchored(edge["bends"], poses)
            for a, b, edge in self.graph.edges(data=True)
            if "bends" in edge
        }

    def apply_poses(self, poses: Poses, moving: Mask) -> None:
        """Move nodes and bends with the keyframes that are ``moving`` (K,); the next :meth:`update` adapts both."""
        self._node_set.move_to(self._places.at(poses), moving[self._places.keyframe])
        for edge, bends in self._bends.items():
            self.graph.edges[edge]["bends"] = bends.at(poses)

    def edge_path(self, a: int, b: int) -> Places:
        """(N, 3) points in ``map``, m, of the path along an edge from node ``a`` to node ``b``."""
        bends = self.graph.edges[a, b].get("bends", np.zeros((0, 3)))
        return np.vstack([self.nodes[a].position, bends if a < b else bends[::-1], self.nodes[b].position])

    def drive_costs_from(self, xy: Place, traversability: Traversability) -> dict[int, float]:
        """Costs of the straight drives from a point (2,), m, to nodes, s, by node id."""
        ends = np.array([node.position[:2] for node in self.nodes.values()]).reshape(-1, 2)
        seconds = drive_seconds(traversability, xy[None], ends)
        return {n: float(s) for n, s in zip(self.nodes, seconds, strict=True) if np.isfinite(s)}

    def save(self, path: Path) -> None:
        """Write nodes and edges as JSON; InputError if the file cannot be written."""
        nodes = [
            {"id": n.id, "label": n.label.name.lower(), "position": n.position.round(3).tolist()}
            for n in self.nodes.values()
        ]
        edges = [
            {
                "nodes": [a, b],
                "length": round(e["length"], 3),
                "seconds": round(e["weight"], 2),
                "tree": self.tree.has_edge(a, b),
                "way": self.edge_path(a, b).round(3).tolist(),
            }
            for a, b, e in self.graph.edges(data=True)
        ]
        with atomic_write(path) as partial:
            partial.write_text(json.dumps({"nodes": nodes, "edges": edges}, indent=1) + "\n")

    def _reachable(self, paths: PosePaths) -> MaskLayer:
        """Cells that the robot can reach; if it can reach no node, also the cells reachable from the nodes."""
        places = [node.position for node in self.nodes.values()]
        if not places or paths.traversability.grid.at(paths.reachable, np.array(places)).any():
            return paths.reachable
        return paths.reachable | PosePaths(paths.traversability, places).reachable


def collision_free_tree(free: nx.Graph) -> nx.Graph:
    """The minimum spanning trees of the edges that meet no obstacle, one tree for each connected group of nodes.

    The thesis computes the tree of the complete graph and adds a huge number to the weights of the tree's edges that
    meet a wall. Both steps are repeated until no edge of the tree meets a wall. The result is the same tree. Because
    all edges are tested anyway, one pass over the free edges is enough.

    Args:
        free: graph of all nodes and of the edges that can be driven, with ``weight``.
    """
    return nx.minimum_spanning_tree(free)


def roadmap(tree: nx.Graph, drives: nx.Graph, max_detour: float) -> nx.Graph:
    """The tree with other drives, so that no path costs more than ``max_detour`` times the minimum over all drives.

    This is a greedy spanner (Althöfer et al. 1993) that starts with the tree. Drives are considered in order of their
    weight. A drive is added if the cheapest path so far between its ends costs more than ``max_detour`` times its
    weight.

    Args:
        tree: graph of all nodes and some of the drives.
        drives: graph of all drives between these nodes, with ``weight``.
        max_detour: maximum ratio between the costs of paths, at least 1.
    """
    graph = tree.copy()
    row = {n: k for k, n in enumerate(graph)}
    way = shortest_path(nx.to_scipy_sparse_array(graph, dtype=float))
    for a, b, data in sorted(drives.edges(data=True), key=lambda d: (d[2]["weight"], *sorted(d[:2]))):
        if way[row[a], row[b]] > max_detour * data["weight"]:
            graph.add_edge(a, b, **data)
            _update_shortest_paths(way, row[a], row[b], data["weight"])
    return graph


def _update_shortest_paths(lengths: NDArray[np.float64], i: int, j: int, weight: float) -> None:
    """Update the lengths (N, N) of all shortest paths for a new edge between i and j."""
    through = lengths[:, i, None] + (lengths[j] + weight)
    np.minimum(lengths, np.minimum(through, through.T), out=lengths)
