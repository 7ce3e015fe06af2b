"""Draw the picture for topological-map.md: the spanning tree of a run's map, and the roadmap with a planned path."""

import json
from pathlib import Path
from typing import Any

import cv2
import networkx as nx
import numpy as np
from numpy.typing import NDArray

from pipeline.elevation_map.traversability import Traversability
from pipeline.labels import COLOURS, Label
from pipeline.planning.pose_paths import PosePaths
from sarsim.composition import make_mapper
from sarsim.robots.model import robot_model
from sarsim.settings import PerceptionConfig
from scripts.pictures.layout import BACKGROUND, INK, beside, save

CELL_SIDE = 8
"""Side of a drawn cell, pixels."""
MARGIN = 8
"""Margin around the traversable ground, cells."""
KNOWN, HAZARD, TRAVERSABLE, RAMP = (58, 62, 68), (150, 154, 160), (92, 97, 104), (70, 92, 150)
TREE, LOOP, PLAN = INK, (255, 150, 30), (60, 190, 90)


class Picture:
    """The ground from above, with paths, nodes and edges drawn over it."""

    def __init__(self, traversability: Traversability):
        """Paint the ground: unknown, known, hazards, traversable, ramps."""
        ground = np.full((*traversability.grid.shape, 3), BACKGROUND, np.uint8)
        ground[~np.isnan(traversability.elevation)] = KNOWN
        ground[traversability.traversable] = TRAVERSABLE
        ground[traversability.traversable & traversability.ramp] = RAMP
        ground[traversability.hazard] = HAZARD
        cells = np.argwhere(traversability.traversable)
        self._grid, self._low = traversability.grid, cells.min(axis=0) - MARGIN
        high = cells.max(axis=0) + MARGIN
        ground = ground[self._low[0] : high[0], self._low[1] : high[1]]
        self.image = np.ascontiguousarray(
            np.kron(ground, np.ones((CELL_SIDE, CELL_SIDE, 1), np.uint8)).swapaxes(0, 1)[::-1]
        )

    def draw_path(self, path: NDArray[np.floating], colour: tuple[int, int, int], width: int) -> None:
        """Draw a path (N, 2 or 3), m, with a width in pixels."""
        cv2.polylines(self.image, [self._pixels(path)], False, colour, width, cv2.LINE_AA)

    def draw_edge(self, edge: dict[str, Any]) -> None:
        """Draw an edge, in different colours for edges of the tree and for edges that only the roadmap has."""
        self.draw_path(np.array(edge["way"]), TREE if edge["tree"] else LOOP, 3)

    def draw_node(self, node: dict[str, Any]) -> None:
        """Draw a node in the colour of its label."""
        middle = self._pixels(np.array([node["position"]]))[0].tolist()
        cv2.circle(self.image, middle, 11, BACKGROUND, -1, cv2.LINE_AA)
        cv2.circle(self.image, middle, 9, COLOURS[Label[node["label"].upper()]].tolist(), -1, cv2.LINE_AA)

    def _pixels(self, points: NDArray[np.floating]) -> NDArray[np.int32]:
        x, y = ((points[:, :2] - self._grid.origin) / self._grid.cell - self._low).T * CELL_SIDE
        return np.column_stack([x, self.image.shape[0] - y]).astype(np.int32)


def draw(folder: Path) -> None:
    """Draw the topological map of the run in a folder."""
    ground = make_mapper(PerceptionConfig(detector=None), robot_model(), earlier=folder).drivable
    topology = json.loads((folder / "topology.json").read_text())
    tree, roadmap = Picture(ground), Picture(ground)
    roadmap.draw_path(farthest_plan(topology, ground), PLAN, 10)
    for edge in topology["edges"]:
        roadmap.draw_edge(edge)
        if edge["tree"]:
            tree.draw_edge(edge)
    for node in topology["nodes"]:
        tree.draw_node(node)
        roadmap.draw_node(node)
    save("topological-map.jpg", beside(tree.image, roadmap.image, gap=16))


def farthest_plan(topology: dict[str, Any], ground: Traversability) -> NDArray[np.float64]:
    """(N, 2) m, positions on the path between the two nodes that are farthest apart on the roadmap."""
    graph, places = nx.Graph(), {node["id"]: np.array(node["position"][:2]) for node in topology["nodes"]}
    graph.add_weighted_edges_from((*edge["nodes"], edge["seconds"]) for edge in topology["edges"])
    ways = dict(nx.all_pairs_dijkstra_path_length(graph))
    a, b = max(((a, b) for a in ways for b in ways[a]), key=lambda pair: ways[pair[0]][pair[1]])
    return np.vstack([places[a], PosePaths(ground, places[a]).straightened_path_to(places[b]).places[:, :2]])
