"""The nodes, the cells that they see, and the straight drives between them, kept consistent with each other."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import networkx as nx
import numpy as np

from pipeline.arrays import Cells, Mask, MaskLayer, Place, Places, Values
from pipeline.elevation_map.traversability import Traversability
from pipeline.labels import Label
from pipeline.segments.crossings import are_blocked
from pipeline.segments.segment import Segment
from pipeline.topological_map.config import TopologicalMapConfig
from pipeline.topological_map.cover import NodeCover

WALL_GAP = 0.15
"""Distance within which a wall of the semantic map blocks a line, m.

The traversability already keeps the entire footprint away from hazards.
"""


class StraightDrives:
    """Tests which straight lines the robot can drive, according to the maps of one step.

    Attributes:
        traversability: where the robot may drive.
        walls: the segments of walls.
    """

    def __init__(self, traversability: Traversability, walls: Sequence[Segment]):
        self.traversability = traversability
        self.walls = walls

    def are_free(self, starts: Places, ends: Places) -> Mask:
        """(N,) whether the footprint, swept along lines between points (N, 3) on the ground, meets no obstacle.

        The traversability covers drops, steps, the sides of ramps, tilt, low ceilings and unknown ground. Segments
        of walls block a line at heights between half the body's height and the headroom.
        """
        free = np.isfinite(self.traversability.line_seconds(starts, ends))
        robot = self.traversability.robot
        lift = np.array([0, 0, robot.body_height / 2])
        height = robot.headroom - robot.body_height / 2
        free[free] = ~are_blocked(starts[free] + lift, ends[free] + lift, self.walls, WALL_GAP, height)
        return free


def drive_seconds(traversability: Traversability, starts: Places, ends: Places) -> Values:
    """(N,) s, costs of driving straight from ``starts`` to ``ends``, one or N points each, and of stopping once."""
    return traversability.line_seconds(starts, ends) + traversability.config.costs.bend


@dataclass(frozen=True, eq=False)
class Node:
    """A position where the robot may stop and plan.

    Attributes:
        id: number of the node, unique in its map and never reused.
        label: label of the segment on which, or in front of whose bottom edge, the node lies.
        position: (3,) position on the ground, m.
    """

    id: int
    label: Label
    position: Place


class NodeSet:
    """The nodes of a topological map, with methods to add, move and remove nodes.

    Attributes:
        nodes: the nodes by id.
        drive_graph: networkx graph of all straight drives between nodes, with ``weight``, s, and ``length``, m.
        cover: which cells the nodes see.
        straight_drives: which straight lines can be driven.
    """

    straight_drives: StraightDrives

    def __init__(self, config: TopologicalMapConfig) -> None:
        self._config = config
        self.nodes: dict[int, Node] = {}
        self.drive_graph = nx.Graph()
        self.cover = NodeCover(config)
        self._next_id = 0
        self._moved: list[Place] = []

    def renew(self, traversability: Traversability, reachable: MaskLayer, walls: Sequence[Segment]) -> MaskLayer:
        """Adapt the nodes to the ground, and return the cells that changed, including those of moved nodes.

        A node at which the robot cannot turn is moved by up to ``max_snap_distance`` m, or removed. See
        :meth:`NodeCover.update` for the arguments.
        """
        changed = self.cover.update(traversability, reachable, walls)
        changed |= self.cover.grid.mask_of(np.reshape(self._moved, (-1, 3)))
        self._moved.clear()
        self.straight_drives = StraightDrives(traversability, walls)
        nodes = list(self.nodes.values())
        stand = self.cover.grid.at(self.cover.standable, np.array([n.position for n in nodes]).reshape(-1, 3))
        for k in np.flatnonzero(~stand):
            self._relocate(nodes[k])
        self._retest_drives(changed)
        return changed

    def _relocate(self, node: Node) -> None:
        """Move a node to where the robot can turn, or else remove it, unless this would disconnect other nodes."""
        cover = self.cover
        xy = cover.grid.nearest(cover.standable, node.position, self._config.max_snap_distance)
        parts = len(self.components())
        self.remove(node.id)
        if xy is not None:
            self._put(node.id, node.label, xy)
        if len(self.components()) > parts and cover.grid.at(cover.target, node.position):
            if xy is not None:
                self.remove(node.id)
            self._put(node.id, node.label, node.position[:2])

    def move_to(self, positions: Places, moving: Mask) -> None:
        """Move the nodes that are ``moving`` (N,) to (N, 3) positions; the next :meth:`renew` tests their drives."""
        nodes = list(self.nodes.values())
        for k in np.flatnonzero(moving):
            node = nodes[k]
            self.cover.remove(node.id)
            self.cover.add(node.id, positions[k, :2])
            self.nodes[node.id] = Node(node.id, node.label, positions[k])
            self._moved += [node.position, positions[k]]

    def add(self, label: Label, xy: Place) -> int:
        """Add a node at a position (2,), m; return its id."""
        self._put(self._next_id, label, xy)
        self._next_id += 1
        return self._next_id - 1

    def remove(self, node: int) -> None:
        """Remove a node and its edges."""
        del self.nodes[node]
        self.drive_graph.remove_node(node)
        self.cover.remove(node)

    def links_from(self, places: Places, without: Collection[int] = ()) -> list[list[int]]:
        """For each position (K, 2), the ids of the nodes, except ``without``, that a straight drive joins to it."""
        ids = [n for n in self.nodes if n not in without]
        ends = np.array([self.nodes[n].position for n in ids]).reshape(-1, 3)
        starts = self.cover.traversability.on_ground(places)
        free = self.straight_drives.are_free(np.repeat(starts, len(ids), axis=0), np.tile(ends, (len(places), 1)))
        return [[ids[k] for k in np.flatnonzero(row)] for row in free.reshape(len(places), len(ids))]

    def components(self, without: Collection[int] = ()) -> list[set[int]]:
        """The groups of nodes, except ``without``, that straight drives connect, the largest first."""
        # This code does not use networkx, which takes twenty times as long if nodes are left out.
        near = dict(self.drive_graph.adjacency())
        parts = list[set[int]]()
        left = near.keys() - set(without)
        while left:
            part = set[int]()
            fresh = {left.pop()}
            while fresh:
                part |= fresh
                fresh = {m for n in fresh for m in near[n]} & left
                left -= fresh
            parts.append(part)
        return sorted(parts, key=lambda part: (-len(part), min(part)))

    def _put(self, node: int, label: Label, xy: Place) -> None:
        """Add a node with a given id at a position (2,), m, and its edges."""
        linked = self.links_from(xy[None])[0]
        self.nodes[node] = Node(node, label, self.cover.traversability.on_ground(xy[None])[0])
        self.cover.add(node, xy)
        self.drive_graph.add_node(node)
        self._add_edges(np.array([(node, n) for n in linked], np.int64).reshape(-1, 2))

    def _retest_drives(self, changed: MaskLayer) -> None:
        """Test drives again if their bounding boxes overlap the bounding box of the ``changed`` cells."""
        if not changed.any() or len(self.nodes) < 2:
            return
        cells = np.argwhere(changed)
        half = self.cover.grid.cell / 2
        low = self.cover.grid.centre_of(cells.min(axis=0)) - half
        high = self.cover.grid.centre_of(cells.max(axis=0)) + half
        ids = np.array(list(self.nodes))
        places = np.array([self.nodes[n].position for n in ids])
        i, j = np.triu_indices(len(ids), 1)
        touched = (np.maximum(places[i], places[j])[:, :2] >= low).all(axis=1)
        touched &= (np.minimum(places[i], places[j])[:, :2] <= high).all(axis=1)
        free = self.straight_drives.are_free(places[i[touched]], places[j[touched]])
        pairs = np.stack([ids[i[touched]], ids[j[touched]]], axis=1)
        self.drive_graph.remove_edges_from(pairs[~free].tolist())
        self._add_edges(pairs[free])

    def _add_edges(self, pairs: Cells) -> None:
        starts, ends = (np.array([self.nodes[n].position for n in side]).reshape(-1, 3) for side in pairs.T)
        length = np.linalg.norm((ends - starts)[:, :2], axis=1)
        seconds = drive_seconds(self.straight_drives.traversability, starts, ends)
        for (a, b), m, s in zip(pairs.tolist(), length, seconds, strict=True):
            self.drive_graph.add_edge(a, b, weight=float(s), length=float(m))
