"""Path plan (thesis 3.4): Dijkstra's algorithm on the topological map."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import networkx as nx
import numpy as np
from numpy.typing import ArrayLike

from pipeline.arrays import Mask, Place, Places
from pipeline.elevation_map.traversability import Traversability
from pipeline.errors import required
from pipeline.planning.pose_paths import PosePaths, StraightenedPath
from pipeline.planning.visiting_order import visiting_order

UNREACHABLE_COST = 1e5
"""Cost assumed between goals that no route connects, s."""


@dataclass(frozen=True, eq=False)
class PathPlan:
    """A path to a goal that consists of straight drives and turns in place.

    Attributes:
        waypoints: (N, 3) ends of the drives, the goal last, m.
        backwards: (N,) whether each drive is backwards.
        nodes: ids of the nodes on the route, in order.
        length: horizontal length of the path from the robot's position, m.
    """

    waypoints: Places
    backwards: Mask
    nodes: list[int]
    length: float


class PlanningNode(Protocol):
    """A node of a planning graph, at a position on the ground."""

    @property
    def position(self) -> Place:
        """(3,) position on the ground, m."""
        ...


class PlanningGraph(Protocol):
    """The graph used for planning, which is a topological map.

    Attributes:
        kind: ``mst``, a tree in which paths pass through the nodes of the route, or ``roadmap``, in which paths need
            not pass through nodes.
        graph: graph of node ids; the weight of an edge is the cost of the drive along the edge, s.
    """

    kind: Literal["mst", "roadmap"]
    graph: nx.Graph

    @property
    def nodes(self) -> Mapping[int, PlanningNode]:
        """The nodes by id."""
        ...

    def drive_costs_from(self, xy: Place, traversability: Traversability) -> dict[int, float]:
        """Costs, s, of straight drives from a position ``xy`` (2,), m, to nodes, by node id."""
        ...


class Planner(Protocol):
    """Plans the path to a viewpoint or goal."""

    def plan(
        self, topology: PlanningGraph, paths: PosePaths, goal: ArrayLike, heading: float | None = None
    ) -> PathPlan | None:
        """The plan from the start of ``paths`` to a goal; None if no path leads there.

        Args:
            topology: the topological map.
            paths: the cheapest paths from the robot's pose, and the ground.
            goal: (2 or 3,) position in ``map``, m.
            heading: heading with which the robot must arrive, rad; None for any.
        """
        ...


class TopologicalPlanner:
    """The planner of the thesis, :func:`plan_path`."""

    def plan(
        self, topology: PlanningGraph, paths: PosePaths, goal: ArrayLike, heading: float | None = None
    ) -> PathPlan | None:
        """See :class:`Planner`."""
        return plan_path(topology, paths, goal, heading)


TOPOLOGICAL = TopologicalPlanner()


def plan_path(
    topology: PlanningGraph, paths: PosePaths, goal: ArrayLike, heading: float | None = None
) -> PathPlan | None:
    """The plan from the start of ``paths`` to a goal (2 or 3,), m, with a given final heading, rad, or any heading.

    Dijkstra's algorithm on the topological map gives the nodes of the route. On the tree, the path passes through
    these nodes, unless a single straight drive reaches the goal. On the roadmap, the path is the result of the search
    over poses, which takes less time to drive and need not pass through the nodes. Returns None if no path leads to
    the goal; :func:`unreachable_reason` gives the reason.
    """
    traversability, goal = paths.traversability, np.asarray(goal, np.float64)[:2]
    if unreachable_reason(paths, goal) is not None:
        return None
    start, way = required(paths.start), paths.straightened_path_to(goal, heading)
    nodes = _nodes_between(topology, traversability, start, goal) if len(way.places) > 1 else []
    ways = [way]
    if topology.kind == "mst" and nodes:
        over = _paths_through([topology.nodes[n].position[:2] for n in nodes], paths, goal, heading)
        ways, nodes = (over, nodes) if over else (ways, [])
    places = np.vstack([w.places for w in ways])
    length = float(np.linalg.norm(np.diff(np.vstack([start, places]), axis=0), axis=1).sum())
    return PathPlan(traversability.on_ground(places), np.concatenate([w.backwards for w in ways]), nodes, length)


def _paths_through(
    places: Sequence[Place], paths: PosePaths, goal: Place, heading: float | None
) -> list[StraightenedPath]:
    """The paths to positions (2,), in turn, and to the goal; an empty list if any of them cannot be reached."""
    legs: list[StraightenedPath] = []
    for place in places:
        if not np.isfinite(paths.cost_to(place)):
            return []
        legs.append(paths.straightened_path_to(place))
        paths = PosePaths(paths.traversability, place, legs[-1].heading, paths.caution)
    return [*legs, paths.straightened_path_to(goal, heading)] if np.isfinite(paths.cost_to(goal)) else []


def unreachable_reason(paths: PosePaths, goal: ArrayLike) -> str | None:
    """The reason why the robot cannot drive to a goal (2 or 3,), m, as a line of the log; None if it can."""
    traversability, goal = paths.traversability, np.asarray(goal, np.float64)[:2]
    grid, name = traversability.grid, goal_name(goal)
    if not np.isfinite(goal).all():
        return f"{name} must have finite coordinates"
    if paths.start is None:
        return f"{name} cannot be reached: the robot cannot leave its current position"
    # The cost is also finite at the robot's position, and where it could escape to, even if it could not otherwise
    # stand there.
    if np.isfinite(paths.cost_to(goal)):
        return None
    if np.isnan(grid.at(traversability.elevation, goal, outside=np.nan)):
        # Unseen ground this close to a hazard may be the inside of a wall.
        if grid.at(traversability.to_hazard, goal, outside=np.inf) < traversability.robot.half_width:
            return f"{name} is in a wall or just behind one: the ground there was not seen"
        return f"{name} is outside the mapped area: the ground there was not seen"
    # The top of a wall that is two cells thick is level, so it is not itself a hazard.
    if grid.at(traversability.to_hazard, goal) <= grid.cell:
        return f"{name} is in a wall, on a step or on ground that is too steep"
    if not grid.at(traversability.traversable, goal):
        return f"{name} is too close to an obstacle or to unknown ground"
    return f"{name} cannot be reached from {place_name(paths.start[:2])}: there is no drivable path"


def goal_name(goal: Place) -> str:
    """The name of a goal (2,) in the log."""
    return f"the goal {place_name(goal)}"


def place_name(xy: Place) -> str:
    """The name of a position (2,) in the log."""
    x, y = np.round(xy, 2) + 0.0  # Turns -0 into 0
    return f"({x:.2f}, {y:.2f}) m"


def order_goals(paths: PosePaths, goals: Sequence[ArrayLike]) -> list[int]:
    """The order in which to visit several goals so that the drive from the start of ``paths`` is short.

    Goals that the robot cannot drive to are left out; :func:`unreachable_reason` gives the reason.

    Returns:
        Indices of ``goals``.
    """
    places = [np.asarray(goal, np.float64)[:2] for goal in goals]
    wanted = [k for k, place in enumerate(places) if unreachable_reason(paths, place) is None]
    there = [paths, *(PosePaths(paths.traversability, places[k], caution=paths.caution) for k in wanted)]
    seconds = np.zeros((len(wanted) + 1, len(wanted) + 1))
    for row, ways in zip(seconds, there, strict=False):
        row[1:] = [min(ways.cost_to(places[k]), UNREACHABLE_COST) for k in wanted]
    return [wanted[k - 1] for k in visiting_order(np.maximum(seconds, seconds.T))]


def _nodes_between(topology: PlanningGraph, traversability: Traversability, start: Place, goal: Place) -> list[int]:
    """Ids of the nodes on the fastest route, by Dijkstra's algorithm; empty if no route leads through nodes."""
    graph = topology.graph.copy()
    for name, xy in (("start", start), ("goal", goal)):
        graph.add_node(name)
        graph.add_weighted_edges_from((name, n, s) for n, s in topology.drive_costs_from(xy, traversability).items())
    try:
        return nx.dijkstra_path(graph, "start", "goal")[1:-1]
    except nx.NetworkXNoPath:
        return []
