"""Path plan (thesis 3.4): Dijkstra's algorithm on the topological map."""

from dataclasses import dataclass

import networkx as nx
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.surface.drivable import DrivableSurface
from pipeline.surface.paths import ShortestPaths, simplify
from pipeline.topological_map.topological_map import TopologicalMap


@dataclass(frozen=True, eq=False)
class PathPlan:
    """A way to a goal.

    Attributes:
        way_points: (N, 3) m in ``map``, from the first place to drive to up to the goal.
        nodes: ids of the nodes that the way leads over.
        length: m along the ground plan, from where the robot is.
    """

    way_points: NDArray[np.float64]
    nodes: list[int]
    length: float


def plan_path(
    topology: TopologicalMap, surface: DrivableSurface, paths: ShortestPaths, goal: ArrayLike
) -> PathPlan | None:
    """The shortest way over the topological map from where ``paths`` start.

    The robot and the goal are joined to every node that a straight drive reaches; if there is none, the bends of
    the shortest way over the grid become nodes. Returns None if no way leads to the goal.
    """
    goal = np.asarray(goal, np.float64)[:2]
    if paths.start is None or not np.isfinite(paths.cost_to(goal)):
        return None
    start = paths.start
    if surface.lines_are_drivable(start[None], goal[None])[0]:
        return _plan(surface, start, [goal], [])
    nodes = _nodes_between(topology, surface, start, goal)
    if nodes is None:
        way = simplify(surface, paths.path_to(goal))[1:]
        return _plan(surface, start, [*way[:-1], goal], [])
    return _plan(surface, start, [*(topology.nodes[n].position[:2] for n in nodes), goal], nodes)


def _nodes_between(
    topology: TopologicalMap, surface: DrivableSurface, start: NDArray[np.float64], goal: NDArray[np.float64]
) -> list[int] | None:
    """Ids of the nodes on the shortest way, by Dijkstra's algorithm; None if there is no way over nodes."""
    graph = topology.graph.copy()
    for name, xy in (("start", start), ("goal", goal)):
        graph.add_node(name)
        for n in topology.linkable(xy, surface):
            if n in topology.graph:
                graph.add_edge(name, n, weight=float(np.linalg.norm(topology.nodes[n].position[:2] - xy)))
    try:
        return nx.dijkstra_path(graph, "start", "goal")[1:-1]
    except nx.NetworkXNoPath:
        return None


def _plan(
    surface: DrivableSurface, start: NDArray[np.float64], way: list[NDArray[np.float64]], nodes: list[int]
) -> PathPlan:
    xy = np.array(way)
    length = float(np.linalg.norm(np.diff(np.vstack([start, xy]), axis=0), axis=1).sum())
    return PathPlan(np.column_stack([xy, surface.grid.at(surface.elevation, xy)]), nodes, length)
