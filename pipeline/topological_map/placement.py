"""Place a small number of connected nodes that together see all the ground: a set cover, updated in each step.

A greedy cover alone would depend on the order in which ground came into view. Therefore nodes near new ground are
thinned out afterwards: a node is removed if other nodes see its cells and stay connected, and two nodes are merged if
a single node can replace both.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from pipeline.arrays import Indices, Place, Places
from pipeline.labels import Label
from pipeline.planning.pose_paths import PosePaths, simplify
from pipeline.robot import RobotModel
from pipeline.segments.planes import PlanePatch
from pipeline.segments.segment import Segment
from pipeline.segments.segments import Segments
from pipeline.topological_map.config import TopologicalMapConfig
from pipeline.topological_map.cover import NodeCover
from pipeline.topological_map.node_set import NodeSet

MIN_LINKED_GAIN = 0.7
"""Fraction of the greatest gain above which a position is preferred if a straight drive joins it to a node."""
MAX_JOINT_DISTANCE = 0.6
"""Distance from a path between two groups of nodes within which a single position that joins them is sought, m."""
MAX_LEVEL_DIFFERENCE = 0.12
"""Maximum difference in height between a segment and ground that belongs to it, m."""
LONG_DECK = 1.8
"""Length above which a deck has a node in each half, m."""


@dataclass(frozen=True, eq=False)
class NodePlace:
    """A position where the thesis places a node.

    Attributes:
        xy: (2,) position, m.
        label: label of the segment at the position.
    """

    xy: Place
    label: Label


def thesis_places(
    patches: Sequence[PlanePatch], segments: Segments, cover: NodeCover, config: TopologicalMapConfig
) -> list[NodePlace]:
    """The thesis's positions on segments and terrain patches, moved to nearby ground where the robot can turn.

    Positions without such ground nearby are left out.
    """
    wanted = [(p, s.label) for s in segments for p in segment_node_positions(s, cover.traversability.robot, config)]
    wanted += [(np.median(p.points.astype(np.float64), axis=0), p.label) for p in patches if p.label is Label.TERRAIN]
    places = []
    for place, label in wanted:
        level = np.abs(cover.traversability.elevation - place[2]) < MAX_LEVEL_DIFFERENCE
        xy = cover.grid.nearest(cover.standable & level, place, config.max_snap_distance)
        if xy is not None:
            places.append(NodePlace(xy, label))
    return places


def label_at(point: Place, segments: Segments) -> Label:
    """The label of a node at a point on the ground: straight ramp on a deck, otherwise terrain.

    A point is on a deck if it is at most ``MAX_LEVEL_DIFFERENCE`` m away from it.
    """
    for segment in segments.of(Label.STRAIGHT_RAMP):
        if segment.tree.query(point)[0] <= MAX_LEVEL_DIFFERENCE:
            return Label.STRAIGHT_RAMP
    return Label.TERRAIN


def segment_node_positions(segment: Segment, robot: RobotModel, config: TopologicalMapConfig) -> Places:
    """(N, 3) m, positions for the nodes of a straight or inclined ramp; other segments have no nodes.

    Ramps that are smaller than the robot or too steep to drive on, such as the sides of ramps, have no nodes either.
    """
    if segment.box.area >= robot.length * robot.width and segment.plane.normal[2] >= np.cos(robot.max_tilt):
        if segment.label is Label.STRAIGHT_RAMP:
            return _centres(segment)
        if segment.label is Label.INCLINED_RAMP:
            return _front_of_ramp(segment, robot.half_length + config.before_ramp)[None]
    return np.zeros((0, 3))


def _centres(segment: Segment) -> Places:
    """(N, 3) m, the centre of a deck, or the centres of the halves of a deck longer than ``LONG_DECK``."""
    T, extent = segment.box.T_map_box, segment.box.extent
    long = int(np.argmax(extent[:2]))
    if extent[long] <= LONG_DECK:
        return T[None, :3, 3]
    quarter = T[:3, long] * extent[long] / 4
    return np.stack([T[:3, 3] - quarter, T[:3, 3] + quarter])


def _front_of_ramp(segment: Segment, distance: float) -> Place:
    """The position ``distance`` m in front of the bottom edge of an inclined ramp, where the robot stands level."""
    box = segment.box
    downhill = np.array([*segment.plane.normal[:2], 0.0])
    downhill /= np.linalg.norm(downhill)
    # The box's y axis runs along the slope; the sign turns it downhill.
    along = box.T_map_box[:3, 1] * np.sign(box.T_map_box[:3, 1] @ downhill)
    return box.T_map_box[:3, 3] + along * box.extent[1] / 2 + downhill * distance


class Placement:
    """Places nodes on the ground of one step."""

    def __init__(self, nodes: NodeSet, places: Sequence[NodePlace], segments: Segments, config: TopologicalMapConfig):
        """``places``: positions from the thesis's rules for nodes, preferred to all other positions."""
        self._nodes = nodes
        self._cover = nodes.cover
        self._places = places
        self._segments = segments
        self._config = config

    def add_places(self) -> None:
        """Add nodes at the thesis's positions that see at least ``min_place_gain`` m² of ground that no node sees."""
        least = self._config.min_place_gain / self._cover.grid.cell**2
        for place in self._places:
            if self._cover.gains(self._cover.visible_from(place.xy[None]))[0] >= least:
                self._nodes.add(place.label, place.xy)

    def cover_rest(self) -> None:
        """Add nodes for the cells that no node sees, greedily by the gain of each node."""
        cover = self._cover
        spare = self._config.max_uncovered_cells
        visible = cover.visible_from(cover.candidates(cover.wanted, self._config.sight, spare + 1))
        while len(visible.places):
            gains = cover.gains(visible)
            if gains.max() <= spare:
                break
            xy = visible.places[self._best(visible.places, gains)]
            self._nodes.add(self._label(xy), xy)
        cover.mark_missing_as_unworthy()

    def _best(self, places: Places, gains: Indices) -> int:
        """Index of the position with the greatest gain, or of one with slightly less gain and a link to a node."""
        order = np.argsort(-gains, kind="stable")
        for k in order[gains[order] >= MIN_LINKED_GAIN * gains.max()]:
            if self._nodes.links_from(places[[k]])[0]:
                return int(k)
        return int(order[0])

    def join(self) -> None:
        """Add nodes near the cheapest path between groups of nodes that straight drives do not connect."""
        for _ in range(len(self._nodes.nodes)):
            parts = self._nodes.components()
            if len(parts) < 2:
                return
            joints = self._joints(parts[0], parts[1:])
            for xy in joints:
                self._nodes.add(self._label(xy), xy)
            if len(self._nodes.components()) >= len(parts):
                return

    def _joints(self, part: set[int], others: Sequence[set[int]]) -> Places:
        """(N, 2) m, positions that join a group of nodes to another: a single position, or else the path's bends."""
        traversability = self._cover.traversability
        nodes = self._nodes.nodes
        # The search starts from the smaller groups, which makes the search front smaller.
        paths = PosePaths(traversability, [nodes[n].position for other in others for n in sorted(other)])
        targets = np.array([nodes[n].position for n in sorted(part)])
        nearest = paths.cheapest(targets)
        if nearest is None:
            return np.zeros((0, 2))
        way = paths.path_to(targets[nearest])
        places = self._cover.candidates(self._cover.grid.mask_of(way), MAX_JOINT_DISTANCE)
        room = traversability.grid.at(traversability.to_hazard, places)
        places = places[np.argsort(-room, kind="stable")]
        for xy, links in zip(places, self._nodes.links_from(places), strict=True):
            if part & set(links) and not part >= set(links):
                return xy[None]
        return simplify(way, traversability)[1:-1]

    def thin_out(self, active: set[int]) -> None:
        """Remove ``active`` nodes or merge them with others, without losing ground or connections."""
        cover = self._cover
        # Remove nodes that see hardly any ground that other nodes do not see, and that connect no other nodes. Nodes
        # with the least such ground come first.
        for n in sorted(active, key=lambda n: len(cover.lost_without([n]))):
            is_spare = len(cover.lost_without([n])) <= self._config.max_uncovered_cells
            if is_spare and len(self._nodes.components({n})) <= len(self._nodes.components()):
                self._nodes.remove(n)
        active = active & self._nodes.nodes.keys()
        if len(self._nodes.nodes) < 2 or not active:
            return
        # Merge pairs that one node can replace, at one of the thesis's positions or anywhere around active nodes. A
        # new node may be merged again.
        around = cover.grid.mask_of([self._nodes.nodes[n].position for n in active])
        lattice = cover.candidates(around, self._config.sight)
        candidates = np.vstack([*(place.xy[None] for place in self._places), lattice])
        ids = list(self._nodes.nodes)
        near = KDTree([self._nodes.nodes[n].position[:2] for n in ids]).query_pairs(2 * self._config.sight)
        pairs = deque(pair for i, j in sorted(near) if active & set(pair := (ids[i], ids[j])))
        while pairs:
            pair = pairs.popleft()
            new = self._merge(pair, candidates) if self._nodes.nodes.keys() >= set(pair) else None
            if new is not None:
                pairs.extend((new, n) for n in self._nodes.nodes if n != new)

    def _merge(self, pair: tuple[int, int], candidates: Places) -> int | None:
        """Replace two nodes by one node; return its id, or None if no node at a candidate can replace both."""
        a, b = (self._nodes.nodes[n].position[:2] for n in pair)
        if np.linalg.norm(a - b) > 2 * self._config.sight:
            return None
        good = self._replacements(pair, candidates)
        if not len(good):
            return None
        rest = self._nodes.components(pair)
        parts = len(self._nodes.components())
        for xy in good:
            links = self._nodes.links_from(xy[None], pair)[0]
            if 1 + sum(not part & set(links) for part in rest) <= parts:
                for n in pair:
                    self._nodes.remove(n)
                return self._nodes.add(self._label(xy), xy)
        return None

    def _replacements(self, pair: tuple[int, int], places: Places) -> Places:
        """(K, 2) m, positions of nodes that can replace two nodes.

        The thesis's positions come first; within both groups, positions that see the most cells come first.
        """
        sight = self._config.sight
        spare = self._config.max_uncovered_cells
        cell = self._cover.grid.cell
        lost = self._cover.lost_without(pair)
        middle = np.mean([self._nodes.nodes[n].position[:2] for n in pair], axis=0)
        centre = self._cover.grid.centre_of(lost.mean(axis=0)) if len(lost) else middle
        near = np.linalg.norm(places - centre, axis=1) <= sight
        if len(lost) > 2 * spare:
            # No position sees farther than ``sight`` in any direction.
            low, high = self._cover.grid.centre_of(np.sort(lost, axis=0)[[spare, -1 - spare]])
            near &= ((places >= high - sight - cell) & (places <= low + sight + cell)).all(axis=1)
        rows = np.flatnonzero(near)
        visible = self._cover.visible_from(places[rows])
        good = self._cover.see_all(visible, lost, spare)
        is_other = rows[good] >= len(self._places)
        seen = visible.seen[good].sum(axis=(1, 2))
        return visible.places[good][np.lexsort([-seen, is_other])]

    def _label(self, xy: Place) -> Label:
        """The label of the thesis's position at ``xy``, (2,) m, or else the label of the ground there."""
        for place in self._places:
            if (place.xy == xy).all():
                return place.label
        return label_at(self._cover.traversability.on_ground(xy[None])[0], self._segments)
