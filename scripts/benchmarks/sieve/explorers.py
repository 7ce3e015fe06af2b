"""Strategies to explore a 2D map: at every node, a strategy decides to which node the robot goes next."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.arrays import Cells, Values
from pipeline.planning.visiting_order import visiting_order
from scripts.benchmarks.sieve import grid_kernels as kernels
from scripts.benchmarks.sieve.world import GridWorld, route


class Sights(NamedTuple):
    """What is left to see, and from which nodes.

    Attributes:
        frontiers: (M, 2) row and column of the frontier cells that at least one node sees.
        nodes: (N,) reachable nodes from which the robot has not looked yet.
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
        nodes, frontiers = np.flatnonzero(np.isfinite(ways) & ~world.visited), world.frontiers()
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


EXPLORERS: dict[str, Explorer2D] = {
    "viewpoint_tour": viewpoint_tour,
    "next_best_view": next_best_view,
    "frontier_tour": frontier_tour,
    "nearest_frontier": nearest_frontier,
    "random_tree": random_tree,
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


def explore(world: GridWorld, explorer: Explorer2D, rng: np.random.Generator) -> None:
    """Explore until the map is explored, nothing is left to see or the moves are used up, deciding at every node."""
    while world.moves < world.rules.most_moves and not world.is_explored:
        sights = Sights.of(world)
        if not len(sights.frontiers):
            break
        nodes = route(sights.before, world.here, explorer(world, sights, rng))
        if not nodes:
            break
        world.move(nodes[0])
