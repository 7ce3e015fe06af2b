"""Draw docs/images/topological-map.jpg: the spanning tree, and the roadmap with a plan on it, in the NIST arena."""

from pathlib import Path

import cv2
import networkx as nx
import numpy as np
from numpy.typing import NDArray

from pipeline.elevation_map.traversability import Traversability
from pipeline.explorer import Explorer, Step
from pipeline.labels import COLOURS
from pipeline.planning.path_plan import plan_path
from pipeline.planning.pose_paths import PosePaths
from pipeline.topological_map.topological_map import TopologicalMap
from sarsim.arenas.load import load_arena
from sarsim.composition import TRUE_LABELS, make_mapper
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig

CELL = 8  # pixels per cell
MARGIN = 10  # cells around the traversable ground
UNKNOWN, KNOWN, HAZARD, TRAVERSABLE, RAMP = (255,) * 3, (215,) * 3, (90,) * 3, (248,) * 3, (250, 225, 190)
TREE, LOOP, PLAN = (40, 40, 40), (0, 140, 255), (60, 160, 30)


class Picture:
    """The ground from above, with paths, nodes and edges drawn over it."""

    def __init__(self, traversability: Traversability):
        """Paint the ground: unknown, known, hazards, traversable, ramps."""
        ground = np.full((*traversability.grid.shape, 3), UNKNOWN, np.uint8)
        ground[~np.isnan(traversability.elevation)] = KNOWN
        ground[traversability.traversable] = TRAVERSABLE
        ground[traversability.traversable & traversability.ramp] = RAMP
        ground[traversability.hazard] = HAZARD
        cells = np.argwhere(traversability.traversable)
        self._grid, self._low = traversability.grid, cells.min(axis=0) - MARGIN
        high = cells.max(axis=0) + MARGIN
        ground = ground[self._low[0] : high[0], self._low[1] : high[1]]
        self.image = np.ascontiguousarray(np.kron(ground, np.ones((CELL, CELL, 1), np.uint8)).swapaxes(0, 1)[::-1])

    def line(self, way: NDArray[np.float64], colour: tuple[int, int, int], width: int) -> None:
        """Draw a path (N, 2 or 3)."""
        cv2.polylines(self.image, [self._pixels(way)], False, colour, width, cv2.LINE_AA)

    def nodes(self, topology: TopologicalMap) -> None:
        """Draw the nodes in the colours of their labels."""
        for node in topology.nodes.values():
            middle = self._pixels(node.position[None])[0].tolist()
            cv2.circle(self.image, middle, 11, (40, 40, 40), -1, cv2.LINE_AA)
            cv2.circle(self.image, middle, 9, COLOURS[node.label][::-1].tolist(), -1, cv2.LINE_AA)

    def edges(self, topology: TopologicalMap, graph: nx.Graph) -> None:
        """Draw the edges of the tree in dark, and all others in another colour."""
        for a, b in graph.edges:
            self.line(topology.way(a, b), TREE if topology.tree.has_edge(a, b) else LOOP, 3)

    def _pixels(self, points: NDArray[np.float64]) -> NDArray[np.int32]:
        x, y = ((points[:, :2] - self._grid.origin) / self._grid.cell - self._low).T * CELL
        return np.column_stack([x, self.image.shape[0] - y]).astype(np.int32)


def explored() -> tuple[Explorer, Step]:
    """The explorer and its last step, after an episode in the NIST arena."""
    robot = SimulatedRobot(load_arena("nist_6x4"), SimulationConfig(), seed=0)
    explorer = Explorer(robot, make_mapper(TRUE_LABELS, robot.model))
    step = explorer.step()
    while step.plan is not None:
        explorer.drive(step)
        step = explorer.step()
    robot.close()
    return explorer, step


def farthest_plan(topology: TopologicalMap, traversability: Traversability) -> NDArray[np.float64]:
    """(N, 2) the plan between the two nodes farthest apart on the graph."""
    ways = dict(nx.all_pairs_dijkstra_path_length(topology.graph))
    a, b = max(((a, b) for a in ways for b in ways[a]), key=lambda pair: ways[pair[0]][pair[1]])
    paths = PosePaths(traversability, topology.nodes[a].position)
    plan = plan_path(topology, paths, topology.nodes[b].position)
    assert plan is not None
    assert paths.start is not None
    return np.vstack([paths.start, plan.way_points[:, :2]])


def main() -> None:
    """Explore and draw."""
    explorer, step = explored()
    topology = explorer.mapper.topological_map
    tree, roadmap = Picture(step.traversability), Picture(step.traversability)
    tree.edges(topology, topology.tree)
    roadmap.line(farthest_plan(topology, step.traversability), PLAN, 9)
    roadmap.edges(topology, topology.graph)
    for picture in (tree, roadmap):
        picture.nodes(topology)
    path = Path(__file__).parents[1] / "images" / "topological-map.jpg"
    gap = np.full((tree.image.shape[0], 16, 3), 255, np.uint8)
    cv2.imwrite(str(path), np.hstack([tree.image, gap, roadmap.image]), [cv2.IMWRITE_JPEG_QUALITY, 85])


if __name__ == "__main__":
    main()
