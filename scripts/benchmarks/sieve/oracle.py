"""The oracle on 2D maps: how short the path of a robot that knows the map could have been."""

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from pipeline.arrays import Mask, Values
from sarsim.scoring.view_tours import Leg, ViewTours, cells_shown
from scripts.benchmarks.sieve.world import PAPERS, GridRules, GridScene, GridWorld, route


class GridOracle(ViewTours):
    """Searches for a short tour; viewpoints are the nodes that the robot can reach, a second is the way of a cell.

    Attributes:
        wanted: number of free cells that must be seen.
        nodes: (V,) lattice node of each viewpoint, the start first.
    """

    wanted = 0

    def __init__(self, scene: GridScene, rules: GridRules = PAPERS):
        """Reveal the map."""
        self.world = GridWorld(scene, rules)
        self.world.reveal()
        self.wanted = int(scene.free.sum()) - rules.most_unseen
        self._trees: dict[int, tuple[NDArray[np.float64], NDArray[np.int64]]] = {}
        start, reachable = self.world.here, np.isfinite(self._tree(self.world.here)[0])
        reachable[start] = False
        self.nodes = np.array([start, *np.flatnonzero(reachable)])
        self._view_of = {int(node): view for view, node in enumerate(self.nodes)}
        self._legs: dict[tuple[int, int], Leg] = {}

    @cached_property
    def views(self) -> sparse.csr_array:
        """(V, N) bool, sparse: the free cells that the sensor shows from each viewpoint."""
        free = self.world.scene.free
        seen = [np.flatnonzero(self.world.view(int(node))[free]) for node in self.nodes]
        ends = np.cumsum([0, *map(len, seen)])
        shape = len(seen), int(free.sum())
        return sparse.csr_array((np.ones(ends[-1], np.bool_), np.concatenate(seen), ends), shape=shape)

    @cached_property
    def at_start(self) -> Mask:
        """The cells seen from the start."""
        return self._seen([0])

    def seconds(self, here: int, there: Sequence[int] | slice = slice(None)) -> Values:
        """Cells along the shortest paths from one viewpoint to others, at least one."""
        return np.maximum(self._tree(int(self.nodes[here]))[0][self.nodes[there]], 1)

    def leg(self, here: int, there: int) -> Leg:
        """The shortest path between two viewpoints; the robot looks from every node."""
        if (here, there) not in self._legs:
            ways, before = self._tree(int(self.nodes[here]))
            stops = route(before, int(self.nodes[here]), int(self.nodes[there]))
            way = float(ways[self.nodes[there]])
            self._legs[here, there] = Leg(way, way, self._seen([self._view_of[n] for n in stops]))
        return self._legs[here, there]

    def follow(self, world: GridWorld) -> None:
        """Drive the tour in a world with the same map until it is explored."""
        way = [int(self.nodes[view]) for view in (0, *self.quickest.order)]
        for stop in (stop for a, b in pairwise(way) for stop in route(self._tree(a)[1], a, b)):
            if world.is_explored or world.moves >= world.rules.most_moves:
                break
            world.move(stop)

    def _tree(self, node: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        if node not in self._trees:
            self._trees[node] = self.world.ways(node)
        return self._trees[node]

    def _seen(self, views: Sequence[int]) -> NDArray[np.bool_]:
        seen = np.zeros(self.views.shape[1], np.bool_)
        for view in views:
            seen[cells_shown(self.views, view)] = True
        return seen
