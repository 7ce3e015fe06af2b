"""The oracle on 2D maps: how short the path of a robot that knows the map could have been."""

from collections.abc import Callable, Sequence
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from pipeline.arrays import Mask, Values
from pipeline.errors import InputError
from sarsim.scoring.set_cover import cells_shown, cover_bound
from sarsim.scoring.view_tours import Leg, ViewTours
from sarsim.tasks.grid_scenes import GridScene
from sarsim.tasks.grid_world import SPEED, GridRules, GridWorld, route


class GridOracle(ViewTours):
    """Searches for a short tour with the rules' moves and sensor; viewpoints are the nodes that the robot can reach.

    The search ignores turns, because the sensor sees all around.

    Attributes:
        wanted: number of free cells that must be seen.
        nodes: (V,) lattice node of each viewpoint, the start first.
    """

    wanted = 0

    def __init__(self, scene: GridScene, rules: GridRules, wanted: int | None = None):
        """Reveal the map; by default, ``wanted`` is the number of seen cells that ends an exploration.

        Raises:
            InputError: the sensor does not see all around.
        """
        if rules.field_of_view < 360:
            raise InputError(
                f"the oracle for 2D maps requires a field of view of 360°, not {rules.field_of_view:g}°; "
                "use rules='papers'"
            )
        self.world = GridWorld(scene, rules)
        self.world.reveal()
        self.wanted = int(scene.free.sum()) - rules.most_unseen if wanted is None else wanted
        self._trees: dict[int, tuple[NDArray[np.float64], NDArray[np.int64]]] = {}
        start, reachable = self.world.here, np.isfinite(self._tree(self.world.here)[0])
        reachable[start] = False
        self.nodes = np.array([start, *np.flatnonzero(reachable)])
        self._view_of = {int(node): view for view, node in enumerate(self.nodes)}
        self._legs: dict[tuple[int, int], Leg] = {}

    @cached_property
    def views(self) -> sparse.csr_array:
        """(V, N) bool, sparse: the free cells that the sensor shows from each viewpoint."""
        return self._views(any_heading=False)

    def _views(self, any_heading: bool) -> sparse.csr_array:
        free, view = self.world.scene.free, self.world.view
        seen = [np.flatnonzero(view(int(node), any_heading)[free]) for node in self.nodes]
        ends = np.cumsum([0, *map(len, seen)])
        shape = len(seen), int(self.world.scene.free.sum())
        return sparse.csr_array((np.ones(ends[-1], np.bool_), np.concatenate(seen), ends), shape=shape)

    @cached_property
    def at_start(self) -> Mask:
        """The cells seen from the start."""
        return self._seen([0])

    def seconds(self, here: int, there: Sequence[int] | slice = slice(None)) -> Values:
        """Seconds from one viewpoint to others along the shortest paths, at least the time for one cell."""
        ways = self._tree(int(self.nodes[here]))[0][self.nodes[there]]
        return np.maximum(ways, 1) * self.world.scene.cell / SPEED

    def leg(self, here: int, there: int) -> Leg:
        """The shortest path between two viewpoints; the robot looks from every node."""
        if (here, there) not in self._legs:
            ways, before = self._tree(int(self.nodes[here]))
            stops = route(before, int(self.nodes[here]), int(self.nodes[there]))
            metres = float(ways[self.nodes[there]]) * self.world.scene.cell
            self._legs[here, there] = Leg(metres / SPEED, metres, self._seen([self._view_of[n] for n in stops]))
        return self._legs[here, there]

    def least_way(self) -> float:
        """Lower bound on the length of any path that sees enough, m: the greater of two bounds.

        Each viewpoint of the relaxed set cover costs at least one edge. To see ``wanted`` cells, the robot must also
        go at least as far as the nearest viewpoint of the cell that is ``wanted``-th nearest. A viewpoint here shows
        what the rays of any heading would show.
        """
        views = self._views(any_heading=True)
        ways = self._tree(self.world.here)[0][self.nodes]
        nearest = np.full(views.shape[1], np.inf)
        for view in np.argsort(-ways, kind="stable"):
            nearest[cells_shown(views, int(view))] = ways[view]
        reach = np.sort(nearest)[self.wanted - 1] if self.wanted else 0.0
        at_start = np.zeros(views.shape[1], np.bool_)
        at_start[cells_shown(views, 0)] = True
        cover = cover_bound(views, self.wanted, at_start) * self.world.rules.spacing
        return float(max(reach, cover)) * self.world.scene.cell

    def follow(self, world: GridWorld, on_move: Callable[[GridWorld], object] = lambda world: None) -> str:
        """Drive the tour in a world with the same map until it is explored; return why it ended, as ``explore``."""
        for stop in self.stops():
            if world.is_explored or world.moves >= world.rules.most_moves:
                break
            world.move(stop)
            on_move(world)
        return "nothing_left" if world.is_explored else "steps"

    def stops(self) -> list[int]:
        """The nodes along the fastest tour, each a neighbour of the previous one."""
        way = [int(self.nodes[view]) for view in (0, *self.quickest.order)]
        return [stop for a, b in pairwise(way) for stop in route(self._tree(a)[1], a, b)]

    def _tree(self, node: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        if node not in self._trees:
            self._trees[node] = self.world.ways(node)
        return self._trees[node]

    def _seen(self, views: Sequence[int]) -> NDArray[np.bool_]:
        seen = np.zeros(self.views.shape[1], np.bool_)
        for view in views:
            seen[cells_shown(self.views, view)] = True
        return seen
