"""Strategies to explore a 2D map: at every node, a strategy decides to which node the robot goes next."""

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.arrays import Cells, Values
from pipeline.planning.visiting_order import visiting_order
from sarsim.assets import asset
from sarsim.tasks import grid_kernels as kernels
from sarsim.tasks.grid_world import GridWorld, route
from sarsim.tasks.settings import VIEWPOINTS

if TYPE_CHECKING:
    from sarsim.tasks.viewpoint_network import ViewpointNetwork


class Sights(NamedTuple):
    """What is left to see, and from which nodes.

    Attributes:
        frontiers: (M, 2) row and column of the frontier cells that at least one node sees.
        nodes: (N,) reachable nodes from which something new may be seen. Visited nodes are left out if the sensor
            sees all around; with a narrower field of view, the robot may still turn there.
        visible: (N, M) whether each node sees each frontier.
        ways: (N,) path lengths from the robot to each of these nodes, cells.
        before: for every node of the lattice, its predecessor on the shortest path from the robot, or -1.
    """

    frontiers: Cells
    nodes: NDArray[np.int64]
    visible: NDArray[np.bool_]
    ways: Values
    before: NDArray[np.int64]

    @classmethod
    def of(cls, world: GridWorld) -> "Sights":
        """The sights of a world in its current state."""
        ways, before = world.ways(world.here)
        is_wanted = np.isfinite(ways) & (~world.visited | (world.rules.field_of_view < 360))
        nodes, frontiers = np.flatnonzero(is_wanted), world.frontiers()
        visible = world.visible(nodes, frontiers)
        seen = visible.any(axis=0)
        return cls(frontiers[seen], nodes, visible[:, seen], ways[nodes], before)


TREE = 100
"""Number of attempts to add an edge to a random tree."""

Explorer2D = Callable[[GridWorld, Sights, np.random.Generator], int]
"""Returns the node to go to; called only if at least one node sees a frontier."""


def nearest_frontier(world: GridWorld, sights: Sights, rng: np.random.Generator) -> int:
    """The node from which to see the frontier with the shortest path (Yamauchi 1997)."""
    rows = access(world, sights)
    last = np.linalg.norm(world.nodes[sights.nodes[rows]] - sights.frontiers, axis=1)
    return int(sights.nodes[rows[(sights.ways[rows] + last).argmin()]])


def frontier_tour(world: GridWorld, sights: Sights, rng: np.random.Generator) -> int:
    """The first stop of a short tour over all connected groups of frontiers."""
    thinning = world.rules.thinning
    mask = np.zeros(world.thinned.shape, np.bool_)
    mask[tuple(sights.frontiers.T // thinning)] = True
    pieces, count = ndimage.label(mask, np.ones((3, 3)))
    piece, nodes = pieces[tuple(sights.frontiers.T // thinning)], sights.nodes[access(world, sights)]
    places = []
    for number in range(1, count + 1):
        of_it = np.flatnonzero(piece == number)
        cells = sights.frontiers[of_it]
        middle = np.linalg.norm(cells - cells.mean(axis=0), axis=1).argmin()
        places.append(int(nodes[of_it[middle]]))
    return first_of_tour(world, sorted(set(places)))


def next_best_view(world: GridWorld, sights: Sights, rng: np.random.Generator) -> int:
    """The node that should show most unknown ground per path length, similar to the robot's own exploration."""
    is_one = sights.visible.any(axis=1) & (sights.nodes != world.here)
    nodes, ways = sights.nodes[is_one], sights.ways[is_one]
    return int(nodes[(gains(world, nodes) / ways).argmax()]) if len(nodes) else world.here


def viewpoint_tour(world: GridWorld, sights: Sights, rng: np.random.Generator) -> int:
    """The first stop of a short tour over few viewpoints that together see all frontiers."""
    left, rows = np.ones(len(sights.frontiers), np.bool_), []
    while left.any():
        counts = (sights.visible & left).sum(axis=1)
        rows.append(int(np.lexsort((sights.ways, -counts))[0]))
        left &= ~sights.visible[rows[-1]]
    return first_of_tour(world, sights.nodes[rows].tolist())


def random_tree(world: GridWorld, sights: Sights, rng: np.random.Generator) -> int:
    """The node with the greatest value in a random tree (Bircher et al., ICRA 2016).

    The tree grows from the robot along random known edges. Unknown ground that a node at path length d should show
    has weight exp(−d / reach), and a node's value is the sum along its branch.
    """
    nodes, parents, ways = [world.here], [-1], [0.0]
    for _ in range(TREE):
        parent = int(rng.integers(len(nodes)))
        node = int(rng.choice(world.next_nodes(nodes[parent])))
        if node not in nodes:
            nodes.append(node)
            parents.append(parent)
            ways.append(ways[parent] + float(np.linalg.norm(world.nodes[node] - world.nodes[nodes[parent]])))
    shown = gains(world, np.array(nodes)) * np.exp(-np.array(ways) / world.rules.reach)
    for index in range(1, len(nodes)):  # parents precede their children
        shown[index] += shown[parents[index]]
    if (best := int(shown.argmax())) and shown[best] > shown[0]:
        return nodes[best]
    return nearest_frontier(world, sights, rng)


def random_walk(world: GridWorld, sights: Sights, rng: np.random.Generator) -> int:
    """A random neighbour of the robot's node."""
    return int(rng.choice(world.next_nodes()))


class Learned:
    """Goes to the viewpoint chosen by a network trained with PPO, and chooses again on arrival.

    See assets/weights/explorer.md.
    """

    def __init__(self) -> None:
        """Begin without goals."""
        self._goals = WeakKeyDictionary[GridWorld, int]()

    def __call__(self, world: GridWorld, sights: Sights, rng: np.random.Generator) -> int:
        """The node to go to."""
        goal = self._goals.get(world, world.here)
        if goal == world.here or sights.before[goal] < 0:
            rows, viewpoints = viewpoint_rows(world, sights)
            goal = self._goals[world] = int(sights.nodes[rows[_shipped_network().choice(viewpoints)]])
        return goal


@cache
def _shipped_network() -> "ViewpointNetwork":
    from sarsim.tasks.viewpoint_network import ViewpointNetwork  # here, because the others do not need PyTorch

    return ViewpointNetwork.load(asset("weights", "explorer.safetensors"))


EXPLORERS: dict[str, Explorer2D] = {
    "next_best_view": next_best_view,
    "viewpoint_tour": viewpoint_tour,
    "frontier_tour": frontier_tour,
    "nearest_frontier": nearest_frontier,
    "random_tree": random_tree,
    "learned": Learned(),
    "random_walk": random_walk,
}


def access(world: GridWorld, sights: Sights) -> NDArray[np.int64]:
    """(M,) for each frontier, the row in ``sights.nodes`` of the nearest node that sees it."""
    apart = np.linalg.norm(world.nodes[sights.nodes][:, None] - sights.frontiers, axis=2)
    return np.where(sights.visible, apart, np.inf).argmin(axis=0)


def gains(world: GridWorld, nodes: NDArray[np.int64]) -> NDArray[np.int64]:
    """(N,) number of unknown squares (see ``world.thinned``) that each of (N,) nodes should show."""
    thinning, reach = world.rules.thinning, world.rules.reach // world.rules.thinning
    rows, cols = world.nodes[nodes].T // thinning
    return kernels.unknown_in_view(world.thinned, rows, cols, reach, reach)


def first_of_tour(world: GridWorld, places: list[int]) -> int:
    """The first stop of a short tour from the robot over some nodes."""
    if len(places) == 1:
        return places[0]
    stops = [world.here, *places]
    cost = np.array([world.ways(stop)[0][stops] for stop in stops])
    return stops[visiting_order(cost)[0]]


def viewpoint_rows(world: GridWorld, sights: Sights) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """The nearest nodes that see a frontier: their rows in ``sights``, and their features.

    Returns:
        (N,) rows, and (N, 4) x, y and path length from the robot in units of the sensor's range, and the share of the
        frontiers that the node sees.
    """
    counts = sights.visible.sum(axis=1)
    rows = np.flatnonzero(counts)
    rows = rows[np.argsort(sights.ways[rows], kind="stable")][:VIEWPOINTS]
    away = (world.nodes[sights.nodes[rows]] - world.nodes[world.here])[:, ::-1]
    in_reaches = np.column_stack([away, sights.ways[rows]]) / world.rules.reach
    return rows, np.column_stack([in_reaches, counts[rows] / max(len(sights.frontiers), 1)])


def explore(
    world: GridWorld,
    explorer: Explorer2D,
    rng: np.random.Generator,
    on_move: Callable[[GridWorld], object] = lambda world: None,
) -> str:
    """Explore to the end, deciding at every node; returns ``nothing_left`` or ``steps``, as in report.json.

    ``on_move`` is called after every move.
    """
    while world.moves < world.rules.most_moves:
        sights = Sights.of(world)
        if world.is_explored or not len(sights.frontiers):
            return "nothing_left"
        nodes = route(sights.before, world.here, explorer(world, sights, rng))
        if not nodes:
            return "nothing_left"
        world.move(nodes[0])
        on_move(world)
    return "steps"
