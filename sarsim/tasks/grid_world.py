"""A robot that explores a 2D map: what it knows, where it can go, and what is left to see."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Cells, PixelMask
from pipeline.transforms import wrap_angle
from sarsim.tasks import grid_kernels as kernels
from sarsim.tasks.grid_scenes import GridScene

REACHES = 2
"""Maximum difference in lattice rows, and in columns, between two nodes joined by an edge."""
SPEED, TURN_RATE = 0.5, 1.0
"""Speed (m/s) and turn rate (rad/s) of the robot, the defaults of episodes."""


@dataclass(frozen=True)
class GridRules:
    """The rules of an exploration: sensor, motion and end.

    Attributes:
        reach: range of the sensor, cells.
        field_of_view: horizontal field of view, degrees; with 360 the sensor sees all around.
        ray_step: angle between neighbouring rays, degrees.
        wall: a ray sees fewer cells of a wall than this.
        spacing: distance between neighbouring nodes, cells.
        thinning: side of the squares among which frontiers are found, cells.
        most_unseen: maximum number of free cells left unseen when the map counts as explored.
        most_moves: maximum number of moves along edges, after which an episode is truncated.
    """

    reach: int
    field_of_view: float
    ray_step: float
    wall: int
    spacing: int
    thinning: int
    most_unseen: int
    most_moves: int


PAPERS = GridRules(80, 360.0, 0.5, 10, 20, 4, 250, 128)
"""The tests of ARiADNE (Cao et al., ICRA 2023), according to its public code."""
CAMERA = GridRules(35, 58.0, 1.0, 2, 5, 2, 100, 2000)
"""The robot's RGB-D camera (58°, 3.5 m) on cells of 0.1 m; the map is explored when at most 1 m² is unseen."""
RULES = {"camera": CAMERA, "papers": PAPERS}


class GridWorld:
    """The state of an exploration. The robot is a point on a lattice of nodes that includes its start.

    Attributes:
        belief: (H, W) uint8 known state of each cell: :data:`grid_kernels.IS_UNKNOWN`, ``IS_FREE`` or ``IS_WALL``.
        thinned: the same for squares with sides of ``rules.thinning`` cells.
        nodes: (N, 2) row and column of the cell of each node of the lattice.
        here: the robot's node.
        heading: heading of the robot, rad; 0 is towards higher columns.
        visited: (N,) whether the robot has looked from each node.
        way: distance driven, cells.
        turned: sum of the angles turned, rad.
        moves: number of edges followed.
    """

    def __init__(self, scene: GridScene, rules: GridRules):
        """Begin at the scene's start, and look all around."""
        self.scene, self.rules = scene, rules
        self.belief = np.zeros(scene.free.shape, np.uint8)
        self.thinned = np.zeros(np.array(scene.free.shape) // rules.thinning, np.uint8)
        self._make_lattice()
        self.visited = np.zeros(len(self.nodes), np.bool_)
        self.way, self.turned, self.heading, self.moves = 0.0, 0.0, 0.0, 0
        self._free, self.known_free = int(scene.free.sum()), 0
        self._look(360.0)

    def _make_lattice(self) -> None:
        shape, spacing = self.belief.shape, self.rules.spacing
        rows, cols = (np.arange(s % spacing, shape[axis], spacing) for axis, s in enumerate(self.scene.start))
        index = np.pad(np.arange(len(rows) * len(cols)).reshape(len(rows), len(cols)), REACHES, constant_values=-1)
        self.nodes = np.stack(np.meshgrid(rows, cols, indexing="ij"), axis=-1).reshape(-1, 2)
        span = range(2 * REACHES + 1)
        around = [index[i : i + len(rows), j : j + len(cols)] for i in span for j in span]
        offsets = np.array([(i - REACHES, j - REACHES) for i in span for j in span])
        around.pop(len(around) // 2)
        self._lengths = spacing * np.delete(np.linalg.norm(offsets, axis=1), len(offsets) // 2)
        self._neighbours = np.stack(around, axis=-1).reshape(len(self.nodes), -1)
        self._open = np.zeros(self._neighbours.shape, np.bool_)
        self.here = int(np.flatnonzero((self.nodes == self.scene.start).all(axis=1))[0])

    @property
    def seconds(self) -> float:
        """Time that the robot has spent driving and turning."""
        return self.way * self.scene.cell / SPEED + self.turned / TURN_RATE

    @property
    def unseen(self) -> int:
        """Number of free cells that the robot has not seen."""
        return self._free - self.known_free

    @property
    def is_explored(self) -> bool:
        """Whether at most ``rules.most_unseen`` free cells are unseen."""
        return self.unseen <= self.rules.most_unseen

    @property
    def explored_fraction(self) -> float:
        """Share of the free cells that the robot has seen."""
        return self.known_free / self._free

    def ways(self, start: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """(N,) lengths of the shortest known paths from a node, cells, and (N,) predecessor of each node, or -1."""
        ways, before = kernels.shortest_ways(self._neighbours, self._lengths, self._open, start)
        return ways, before

    def next_nodes(self, node: int | None = None) -> NDArray[np.int64]:
        """(K,) the neighbours of a node, by default the robot's, along known free edges."""
        node = self.here if node is None else node
        nodes: NDArray[np.int64] = self._neighbours[node][self._open[node]]
        return nodes

    def frontiers(self) -> Cells:
        """(M, 2) the centre cells of the free squares that border on unknown squares."""
        return np.argwhere(kernels.frontier_mask(self.thinned)) * self.rules.thinning + self.rules.thinning // 2

    def visible(self, nodes: NDArray[np.int64], frontiers: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(N, M) whether each of (N,) nodes sees each of (M, 2) frontier cells.

        A visible frontier is within 7/8 of the sensor's range, so that some of the ground behind it is seen as well.
        """
        sees = kernels.visible(self.belief, self.nodes[nodes], frontiers, 7 * self.rules.reach / 8)
        return np.asarray(sees, np.bool_)

    def move(self, node: int) -> None:
        """Follow the edge to a node and look there."""
        step = self.nodes[node] - self.nodes[self.here]
        self.way += float(np.linalg.norm(step))
        self.here, self.moves = node, self.moves + 1
        self._turn(float(np.arctan2(step[0], step[1])))
        self._look(self.rules.field_of_view)

    def reveal(self) -> None:
        """Reveal the whole map, for the oracle."""
        self.belief[:] = np.where(self.scene.free, kernels.IS_FREE, kernels.IS_WALL)
        self.known_free = self._free
        self._take_over(np.zeros(2, np.int64), self.belief.size)

    def view(self, node: int, any_heading: bool = False) -> PixelMask:
        """Mask of what a 360° sensor sees from a node at heading 0 or, if ``any_heading``, at any edge's heading."""
        belief, (row, col), rules = np.zeros_like(self.belief), self.nodes[node].tolist(), self.rules
        span = np.arange(-REACHES, REACHES + 1)
        headings = np.unique(np.arctan2(span[:, None], span)) if any_heading else np.zeros(1)
        bearings = np.ravel(headings[:, None] + np.deg2rad(np.arange(-180, 180, rules.ray_step)))
        kernels.sense(self.scene.free, belief, row, col, bearings, rules.reach, rules.wall)
        return belief != kernels.IS_UNKNOWN

    def turn(self, heading: float) -> None:
        """Turn to a heading, rad, and look there."""
        self._turn(heading)
        self._look(self.rules.field_of_view)

    def _turn(self, heading: float) -> None:
        self.turned += abs(wrap_angle(heading - self.heading))
        self.heading = heading

    def _look(self, field_of_view: float) -> None:
        """Add what the sensor sees to the belief; ``field_of_view`` is in degrees."""
        rules, (row, col) = self.rules, self.nodes[self.here].tolist()
        half = field_of_view / 2
        bearings = self.heading + np.deg2rad(np.arange(-half, half, rules.ray_step))
        self.known_free += kernels.sense(self.scene.free, self.belief, row, col, bearings, rules.reach, rules.wall)
        self.visited[self.here] = True
        self._take_over(np.array([row, col]), rules.reach + 1)

    def _take_over(self, middle: NDArray[np.int64], radius: int) -> None:
        """Update thinned map and edges where the belief has changed: within ``radius`` cells of a cell (2,)."""
        kernels.thin(self.belief, self.thinned, self.rules.thinning, middle, radius)
        far = radius + REACHES * self.rules.spacing
        kernels.open_edges(self.belief, self.nodes, self._neighbours, self._open, middle, far)


def route(before: NDArray[np.int64], here: int, node: int) -> list[int]:
    """The path after ``here`` up to ``node``, from the (N,) predecessors of all nodes; empty if there is none."""
    nodes = []
    while node != here and node >= 0:
        nodes.append(node)
        node = int(before[node])
    return nodes[::-1] if node == here else []
