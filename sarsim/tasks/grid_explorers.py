"""Ways to explore a 2D map: each decides, at every node, to which node the robot goes next."""

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
    """What is left to see, and from where.

    Attributes:
        frontiers: (M, 2) cells, those that a node sees.
        nodes: (N,) nodes in reach from which something new may be seen: not where the robot has looked all around; a
            camera that looks one way may still turn there.
        visible: (N, M) whether a node sees a frontier.
        ways: (N,) cells, from the robot to each of these nodes.
        before: of every node of the lattice, the node before it on the shortest way.
    """

    frontiers: Cells
    nodes: NDArray[np.int64]
    visible: NDArray[np.bool_]
    ways: Values
    before: NDArray[np.int64]

    @classmethod
    def of(cls, world: GridWorld) -> "Sights":
        """What a world shows."""
        ways, before = world.ways(world.here)
        is_wanted = np.isfinite(ways) & (~world.visited | (world.rules.field_of_view < 360))
        nodes, frontiers = np.flatnonzero(is_wanted), world.frontiers()
        visible = world.visible(nodes, frontiers)
        seen = visible.any(axis=0)
        return cls(frontiers[seen], nodes, visible[:, seen], ways[nodes], before)


TREE = 100
"""Edges that a random tree tries to grow."""

Explorer2D = Callable[[GridWorld, Sights, np.random.Generator], int]
"""The node to go to; there is at least one frontier that a node sees."""


def nearest_frontier(world: GridWorld, sights: Sights, rng: np.random.Generator) -> int:
    """The node nearest to a frontier, for the frontier to which the way is the shortest (Yamauchi 1997)."""
    rows = access(world, sights)
    last = np.linalg.norm(world.nodes[sights.nodes[rows]] - sights.frontiers, axis=1)
    return int(sights.nodes[rows[(sights.ways[rows] + last).argmin()]])


def frontier_tour(world: GridWorld, sights: Sights, rng: np.random.Generator) -> int:
    """The first of the places in a short tour over all connected frontiers."""
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
    """The node that should show most unknown ground per length of way, as the robot's own exploration chooses."""
    is_one = sights.visible.any(axis=1) & (sights.nodes != world.here)
    nodes, ways = sights.nodes[is_one], sights.ways[is_one]
    return int(nodes[(gains(world, nodes) / ways).argmax()]) if len(nodes) else world.here


def viewpoint_tour(world: GridWorld, sights: Sights, rng: np.random.Generator) -> int:
    """The first of the places in a short tour over few viewpoints that together see all frontiers."""
    left, rows = np.ones(len(sights.frontiers), np.bool_), []
    while left.any():
        counts = (sights.visible & left).sum(axis=1)
        rows.append(int(np.lexsort((sights.ways, -counts))[0]))
        left &= ~sights.visible[rows[-1]]
    return first_of_tour(world, sights.nodes[rows].tolist())


def random_tree(world: GridWorld, sights: Sights, rng: np.random.Generator) -> int:
    """The node of a random tree that should show most for its way (Bircher et al., ICRA 2016).

    The tree grows by random known edges from the robot; unknown ground at way d counts by exp(−d / reach), and what
    the nodes of a branch show is summed.
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
    for index in range(1, len(nodes)):  # a node comes after its parent
        shown[index] += shown[parents[index]]
    if (best := int(shown.argmax())) and shown[best] > shown[0]:
        return nodes[best]
    return nearest_frontier(world, sights, rng)


def random_walk(world: GridWorld, sights: Sights, rng: np.random.Generator) -> int:
    """Any of the nodes at the ends of the edges from here."""
    return int(rng.choice(world.next_nodes()))


class Learned:
    """Goes to the viewpoint that a network chooses, and chooses again there, as it has learned by PPO.

    See assets/weights/explorer.md.
    """

    def __init__(self) -> None:
        """No world is explored yet."""
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
    from sarsim.tasks.viewpoint_network import ViewpointNetwork  # imported here, because the others need no torch

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
    """(M,) the row in ``sights.nodes`` of the node nearest to each frontier among those that see it."""
    apart = np.linalg.norm(world.nodes[sights.nodes][:, None] - sights.frontiers, axis=2)
    return np.where(sights.visible, apart, np.inf).argmin(axis=0)


def gains(world: GridWorld, nodes: NDArray[np.int64]) -> NDArray[np.int64]:
    """(N,) numbers of unknown squares of cells that should show at the nodes (N,)."""
    thinning, reach = world.rules.thinning, world.rules.reach // world.rules.thinning
    rows, cols = world.nodes[nodes].T // thinning
    return kernels.unknown_in_view(world.thinned, rows, cols, reach, reach)


def first_of_tour(world: GridWorld, places: list[int]) -> int:
    """The first of some nodes in a short tour over them from the robot."""
    if len(places) == 1:
        return places[0]
    stops = [world.here, *places]
    cost = np.array([world.ways(stop)[0][stops] for stop in stops])
    return stops[visiting_order(cost)[0]]


def viewpoint_rows(world: GridWorld, sights: Sights) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """The nearest nodes that see a frontier: their rows in ``sights``, and what describes them.

    Returns:
        (N,) rows, and (N, 4) x, y and length of the way in ranges of the sensor, and the share of the frontiers that
        the node sees.
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
    """Explore until the end, deciding at every node; ``nothing_left`` or ``steps``, as in report.json.

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
