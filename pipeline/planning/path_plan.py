"""Path plan (thesis 3.4): Dijkstra's algorithm on the topological map."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import networkx as nx
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.planning.visiting_order import visiting_order
from pipeline.topological_map.links import drive_seconds
from pipeline.topological_map.topological_map import MAX_DETOUR, TopologicalMap
from pipeline.traversability.shortest_paths import ShortestPaths, may_cut, simplify
from pipeline.traversability.traversability import Traversability

THICKEST = 0.3
"""m; unseen ground may be the inside of a wall if a hazard is so near."""


@dataclass(frozen=True, eq=False)
class PathPlan:
    """A way to a goal.

    Attributes:
        way_points: (N, 3) m in ``map``, from the first place to drive to up to the goal.
        nodes: ids of the nodes that the way leads over or past.
        length: m along the ground plan, from where the robot is.
    """

    way_points: NDArray[np.float64]
    nodes: list[int]
    length: float

    def after(self, places: NDArray[np.float64], here: NDArray[np.float64]) -> "PathPlan":
        """The same plan after a drive from here (3,) over places (N, 3) m, at whose last it begins."""
        legs = np.diff(np.vstack([here, places])[:, :2], axis=0)
        length = self.length + float(np.linalg.norm(legs, axis=1).sum())
        return replace(self, way_points=np.vstack([places, self.way_points]), length=length)

    def on_to(self, place: NDArray[np.float64]) -> "PathPlan":
        """The same plan, and then straight on to a place (1, 3) m."""
        leg = float(np.linalg.norm(place[0, :2] - self.way_points[-1, :2]))
        return replace(self, way_points=np.vstack([self.way_points, place]), length=self.length + leg)


def plan_path(topology: TopologicalMap, paths: ShortestPaths, goal: ArrayLike) -> PathPlan | None:
    """The quickest way over the topological map from where ``paths`` start to a goal (2 or 3,), m.

    A goal in sight is driven to straight, unless ramps could be met more head-on. Otherwise the robot and the goal
    are joined to every node that a straight drive reaches; if no way leads over nodes, the shortest way over the grid
    is taken, and on a roadmap also where it is quicker by more than the roadmap's greatest detour: few nodes lie in
    wide curves. Way points that a straight drive can pass by are left out.
    Returns None if no way leads to the goal: :func:`obstacle_to` says why.
    """
    traversability, goal = paths.traversability, np.asarray(goal, np.float64)[:2]
    if obstacle_to(paths, goal) is not None:
        return None
    assert paths.start is not None
    grid_way = np.vstack([paths.start, paths.path_to(goal)[1:-1], goal])
    if may_cut(traversability, grid_way)[-1]:
        return _plan(traversability, grid_way[[0, -1]], [])
    nodes = _nodes_between(topology, traversability, paths.start, goal)
    over_grid = simplify(traversability, grid_way)
    if nodes is None:
        return _plan(traversability, over_grid, [])
    over_nodes = np.vstack([paths.start, _way_over(topology, nodes), goal])
    over_nodes = simplify(traversability, over_nodes, bend_anywhere=True)
    if topology.kind == "roadmap" and _is_quicker(over_grid, over_nodes, traversability):
        return _plan(traversability, over_grid, nodes)
    return _plan(traversability, over_nodes, nodes)


def obstacle_to(paths: ShortestPaths, goal: ArrayLike) -> str | None:
    """Why the robot cannot drive to a goal (2 or 3,), m, in a line for the log; None if it can."""
    traversability, goal = paths.traversability, np.asarray(goal, np.float64)[:2]
    grid, name = traversability.grid, goal_name(goal)
    if not np.isfinite(goal).all():
        return f"{name} is not a place"
    if paths.start is None:
        return f"{name} cannot be driven to: the robot stands where it cannot drive"
    if np.isnan(grid.at(traversability.elevation, goal, outside=np.nan)):
        if grid.at(traversability.to_hazard, goal, outside=np.inf) < THICKEST:
            return f"{name} is in a wall or right behind one: the ground there was not seen"
        return f"{name} is off the map: the ground there was not seen"
    if grid.at(traversability.hazard, goal):
        return f"{name} is in a wall, on a step or on ground too steep"
    if not grid.at(traversability.traversable, goal):
        return f"{name} is too near to an obstacle or to unknown ground"
    if not np.isfinite(paths.cost_to(goal)):
        return f"{name} cannot be reached from ({paths.start[0]:.2f}, {paths.start[1]:.2f}) m"
    return None


def goal_name(goal: NDArray[np.float64]) -> str:
    """The name of a goal (2,) in the log."""
    return f"the goal {place_name(goal)}"


def place_name(xy: NDArray[np.float64]) -> str:
    """The name of a place (2,), m, in the log."""
    x, y = np.round(xy, 2) + 0.0  # which makes 0 of -0
    return f"({x:.2f}, {y:.2f}) m"


def order_goals(topology: TopologicalMap, paths: ShortestPaths, goals: Sequence[ArrayLike]) -> list[int]:
    """The order in which to visit several goals so that the drive from where ``paths`` start is short.

    Times come from the topological map where it links the goals, and from the length of the way over the grid where
    it links none. Goals that the robot cannot drive to are left out: :func:`obstacle_to` says why.

    Returns:
        Indices of ``goals``.
    """
    places = [np.asarray(goal, np.float64)[:2] for goal in goals]
    wanted = [k for k, place in enumerate(places) if obstacle_to(paths, place) is None]
    if not wanted or paths.start is None:
        return []
    seconds = _seconds_between(topology, paths.traversability, np.array([paths.start, *(places[k] for k in wanted)]))
    return [wanted[k - 1] for k in visiting_order(seconds)]


def _seconds_between(
    topology: TopologicalMap, traversability: Traversability, places: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N, N) s from place to place: straight on, over the map, or else as long as a way around is likely to take."""
    names = [f"place {k}" for k in range(len(places))]
    graph = _linked(topology, traversability, dict(zip(names, places, strict=True)))
    result = np.zeros((len(places), len(places)))
    for k, name in enumerate(names):
        straight = drive_seconds(traversability, places[[k]], places)
        reach = nx.single_source_dijkstra_path_length(graph, name)
        over = np.array([reach.get(other, np.inf) for other in names])
        direct = np.where(traversability.lines_are_traversable(places[[k]], places), straight, np.inf)
        least = np.minimum(over, direct)
        result[k] = np.where(np.isfinite(least), least, 2 * straight)
    return result


def _nodes_between(
    topology: TopologicalMap, traversability: Traversability, start: NDArray[np.float64], goal: NDArray[np.float64]
) -> list[int] | None:
    """Ids of the nodes on the quickest way, by Dijkstra's algorithm; None if there is no way over nodes."""
    graph = _linked(topology, traversability, {"start": start, "goal": goal})
    try:
        return nx.dijkstra_path(graph, "start", "goal")[1:-1]
    except nx.NetworkXNoPath:
        return None


def _way_over(topology: TopologicalMap, nodes: list[int]) -> NDArray[np.float64]:
    """(N, 2) the places that the edges from node to node lead over."""
    legs = [topology.way(a, b)[1:, :2] for a, b in pairwise(nodes)]
    return np.vstack([topology.nodes[nodes[0]].position[None, :2], *legs])


def _is_quicker(way: NDArray[np.float64], other: NDArray[np.float64], traversability: Traversability) -> bool:
    """Whether a way (N, 2) that can be driven takes less time than another one by more than the greatest detour."""
    seconds, longer = (drive_seconds(traversability, w[:-1], w[1:]).sum() for w in (way, other))
    return bool(MAX_DETOUR * seconds < longer and traversability.lines_are_traversable(way[:-1], way[1:]).all())


def _linked(
    topology: TopologicalMap, traversability: Traversability, places: Mapping[str, NDArray[np.float64]]
) -> nx.Graph:
    """The graph of the map with places (2,), by name, each joined to every node that a straight drive reaches."""
    graph = topology.graph.copy()
    for name, xy in places.items():
        graph.add_node(name)
        graph.add_weighted_edges_from((name, n, s) for n, s in topology.links_from(xy, traversability).items())
    return graph


def _plan(traversability: Traversability, way: NDArray[np.float64], nodes: list[int]) -> PathPlan:
    """The plan for a way (N, 2) that begins where the robot is."""
    length = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
    return PathPlan(traversability.on_ground(way[1:]), nodes, length)
