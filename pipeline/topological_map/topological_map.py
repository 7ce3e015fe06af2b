"""The topological map (thesis 3.3): few nodes, and a tree of straight drives between them."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from pipeline.files import whole_file
from pipeline.labels import Label
from pipeline.semantic_map.crossings import crossings
from pipeline.semantic_map.planes import PlanePatch
from pipeline.semantic_map.segments import Segment, Segments
from pipeline.surface.drivable import DrivableSurface
from pipeline.surface.paths import ShortestPaths, simplify
from pipeline.topological_map.nodes import NodeConfig, segment_nodes
from pipeline.topological_map.spanning_tree import collision_free_tree

WALL_TEST_HEIGHT = 0.3
"""m above the ground: edges are tested against walls where the robot's body would meet them."""

LEVEL = 0.12
"""m; ground that differs more in height from a segment does not belong to it."""


@dataclass(frozen=True, eq=False)
class Node:
    """A place where the robot may stop and plan.

    Attributes:
        id: unique in its map, never used again.
        label: of the segment that it lies on, or before whose bottom it lies.
        position: (3,) m in ``map``, on the ground.
    """

    id: int
    label: Label
    position: NDArray[np.float64]


class TopologicalMap:
    """Nodes and edges, renewed with every look.

    Attributes:
        nodes: by id.
        graph: networkx graph of the node ids, with the length of each edge in m as ``weight``.
    """

    def __init__(self, config: NodeConfig | None = None):
        self.config = config or NodeConfig()
        self.nodes: dict[int, Node] = {}
        self.graph = nx.Graph()
        self._ramp_ids: dict[tuple[int, int], int] = {}
        self._next_id = 0

    def update(
        self,
        patches: Sequence[PlanePatch],
        segments: Segments,
        surface: DrivableSurface,
        paths: ShortestPaths,
    ) -> None:
        """Take a look into account.

        Args:
            patches: the planes of this look; a terrain patch has a node in its middle.
            segments: all segments so far; the nodes on ramps move with their growing boxes.
            surface: where the robot can stand and drive.
            paths: shortest paths from where the robot is.
        """
        standable = surface.turnable & paths.reachable
        self._drop_lost_nodes(segments, surface, standable)
        self._place_ramp_nodes(segments, surface, standable)
        self._add_terrain_nodes(patches, surface, paths, standable)
        walls = segments.of(Label.WALL)
        self._span(surface, walls)
        self._join_components(surface, walls)

    def add_way_points(self, points: Iterable[NDArray[np.float64]], surface: DrivableSurface) -> None:
        """Make nodes of the bends of a path that no node covers; the tree takes them in with the next look."""
        for xy in points:
            self._add(Label.TERRAIN, xy, surface)

    def linkable(self, xy: NDArray[np.float64], surface: DrivableSurface) -> list[int]:
        """Ids of the nodes that a straight drive joins to a point."""
        ids = list(self.nodes)
        if not ids:
            return []
        ends = np.array([self.nodes[n].position for n in ids])
        free = surface.lines_are_drivable(np.repeat(np.asarray(xy)[None, :2], len(ids), axis=0), ends)
        return [n for n, is_free in zip(ids, free, strict=True) if is_free]

    def save(self, path: Path) -> None:
        """Write nodes and edges as JSON."""
        nodes = [
            {"id": n.id, "label": n.label.name.lower(), "position": n.position.round(4).tolist()}
            for n in self.nodes.values()
        ]
        edges = [{"nodes": [a, b], "length": round(w, 4)} for a, b, w in self.graph.edges(data="weight")]
        with whole_file(path) as partial:
            partial.write_text(json.dumps({"nodes": nodes, "edges": edges}, indent=1) + "\n")

    def _add(
        self, label: Label, xy: NDArray[np.float64], surface: DrivableSurface, node_id: int | None = None
    ) -> int:
        if node_id is None:
            node_id, self._next_id = self._next_id, self._next_id + 1
        z = float(surface.grid.at(surface.elevation, xy))
        self.nodes[node_id] = Node(node_id, label, np.array([xy[0], xy[1], z]))
        return node_id

    def _drop_lost_nodes(
        self, segments: Segments, surface: DrivableSurface, standable: NDArray[np.bool_]
    ) -> None:
        """Forget nodes where the robot, as it is known now, cannot stand, and those of merged segments."""
        alive = {s.id for s in segments}
        self._ramp_ids = {key: n for key, n in self._ramp_ids.items() if key[0] in alive}
        on_ramps = set(self._ramp_ids.values())
        self.nodes = {
            n: node
            for n, node in self.nodes.items()
            if (node.label is Label.TERRAIN or n in on_ramps)
            and surface.grid.nearest(standable, node.position, 0.15) is not None
        }

    def _place_ramp_nodes(
        self, segments: Segments, surface: DrivableSurface, standable: NDArray[np.bool_]
    ) -> None:
        for segment in segments:
            for index, place in enumerate(segment_nodes(segment, self.config)):
                level = np.abs(surface.elevation - place[2]) < LEVEL
                xy = surface.grid.nearest(standable & level, place, self.config.snap)
                key = (segment.id, index)
                if xy is not None:
                    self._ramp_ids[key] = self._add(segment.label, xy, surface, self._ramp_ids.get(key))

    def _add_terrain_nodes(
        self,
        patches: Sequence[PlanePatch],
        surface: DrivableSurface,
        paths: ShortestPaths,
        standable: NDArray[np.bool_],
    ) -> None:
        """A node in the middle of every terrain patch in view, and one where the robot is, if none is near."""
        places = [np.median(p.points.astype(np.float64), axis=0) for p in patches if p.label is Label.TERRAIN]
        if paths.start is not None:
            places.append(paths.start)
        for place in places:
            xy = surface.grid.nearest(standable, place, self.config.snap)
            if xy is not None and not self._is_near_node(xy, surface):
                self._add(Label.TERRAIN, xy, surface)

    def _is_near_node(self, xy: NDArray[np.float64], surface: DrivableSurface) -> bool:
        distance = {n: np.linalg.norm(node.position[:2] - xy) for n, node in self.nodes.items()}
        return any(distance[n] < self.config.spacing for n in self.linkable(xy, surface))

    def _span(self, surface: DrivableSurface, walls: Sequence[Segment]) -> None:
        """Span the tree over all edges that can be driven; the fewest of them need the test against walls."""
        positions = {n: node.position for n, node in self.nodes.items()}
        lift = np.array([0, 0, WALL_TEST_HEIGHT])

        def is_free(a: int, b: int) -> bool:
            return not crossings((positions[a] + lift)[None], (positions[b] + lift)[None], walls)[0]

        pairs = np.array(list(combinations(positions, 2)), np.int64).reshape(-1, 2)
        starts, ends = (np.array([positions[n] for n in side]).reshape(-1, 3) for side in pairs.T)
        edges = pairs[surface.lines_are_drivable(starts, ends)].tolist()
        self.graph = collision_free_tree(positions, edges, is_free)

    def _join_components(self, surface: DrivableSurface, walls: Sequence[Segment]) -> None:
        """Where straight drives leave nodes apart, nodes in the bends of the shortest way join them."""
        for _ in range(len(self.nodes)):
            components = sorted(nx.connected_components(self.graph), key=len, reverse=True)
            if len(components) < 2:
                return
            bends = self._bends_between(components[0], components[1:], surface)
            if not len(bends):
                return
            self.add_way_points(bends, surface)
            self._span(surface, walls)

    def _bends_between(
        self, component: set[int], others: Sequence[set[int]], surface: DrivableSurface
    ) -> NDArray[np.float64]:
        """(N, 2) the bends of the shortest drivable way from one component of the tree to any other."""
        paths = ShortestPaths(surface, [self.nodes[n].position for n in sorted(component)])
        targets = [self.nodes[n].position for other in others for n in sorted(other)]
        nearest = min(targets, key=paths.cost_to)
        if not np.isfinite(paths.cost_to(nearest)):
            return np.zeros((0, 2))
        return simplify(surface, paths.path_to(nearest))[1:-1]
