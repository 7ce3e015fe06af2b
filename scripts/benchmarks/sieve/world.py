"""2D maps, and a robot that explores one: what it knows, where it can go, and what is left to see."""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pipeline.arrays import Cells, PixelMask
from pipeline.errors import InputError
from scripts.benchmarks.sieve import grid_kernels as kernels

START_COLOUR, START_PIXEL = (255, 216, 0), 127
"""Colour of the square on a dungeon map in which the robot starts; the pixel in it, in row-major order."""
LIGHT = 150
"""Grey value above which a pixel of a dungeon map is free."""
SHAPE, ROOMS, LANE = (480, 640), 14, 20
"""Rows and columns of a drawn map, its number of rooms, which may overlap, and the width of its corridors, cells."""
REACHES = 2
"""Maximum difference in lattice rows, and in columns, between two nodes joined by an edge."""


@dataclass(frozen=True, eq=False)
class GridScene:
    """A 2D map and the robot's start.

    Attributes:
        free: free cells; all others are walls.
        start: row and column of the robot's cell.
    """

    free: PixelMask
    start: tuple[int, int]


@dataclass(frozen=True)
class GridRules:
    """The rules of an exploration: sensor, which sees all around, motion and end.

    Attributes:
        reach: range of the sensor, cells.
        wall: a ray sees fewer cells of a wall than this.
        spacing: distance between neighbouring nodes, cells.
        thinning: side of the squares among which frontiers are found, cells.
        most_unseen: maximum number of free cells left unseen when the map counts as explored.
        most_moves: number of moves along edges after which an exploration ends.
    """

    reach: int = 80
    wall: int = 10
    spacing: int = 20
    thinning: int = 4
    most_unseen: int = 250
    most_moves: int = 128


PAPERS = GridRules()
"""The tests of ARiADNE (Cao et al., ICRA 2023), according to its public code; but the lattice contains the start."""
BEARINGS = np.deg2rad(np.arange(-180, 180, 0.5))
"""(N,) bearings of the sensor's rays, rad."""


def read_dungeon(path: Path) -> GridScene:
    """Read a dungeon map, a PNG image; InputError if it cannot be read or has no start."""
    try:
        with Image.open(path) as image:
            pixels = np.asarray(image.convert("RGB"))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise InputError(f"{path}: cannot be read as an image: {' '.join(str(error).split())}") from error
    square = np.argwhere((pixels == START_COLOUR).all(axis=2))
    if len(square) <= START_PIXEL:
        raise InputError(f"{path}: no start: at least {START_PIXEL + 1} pixels must have its colour, {START_COLOUR}")
    row, col = square[START_PIXEL].tolist()
    return GridScene(pixels.max(axis=2) > LIGHT, (row, col))


def draw_scene(seed: int) -> GridScene:
    """Draw rooms, joined into a chain with some loops by corridors; the robot starts in a room."""
    rng = np.random.default_rng(seed)
    free = np.zeros(SHAPE, np.bool_)
    centres = [_draw_room(rng, free) for _ in range(ROOMS)]
    # a greedy chain: each room is followed by the nearest of those that remain
    left, chain = centres[1:], [centres[0]]
    while left:
        chain.append(min(left, key=lambda c: (np.hypot(c[0] - chain[-1][0], c[1] - chain[-1][1]), c)))
        left.remove(chain[-1])
    loops = [rng.choice(ROOMS, 2, replace=False) for _ in range(ROOMS // 4)]
    for a, b in [*pairwise(chain), *((centres[i], centres[j]) for i, j in loops)]:
        # a corridor with one bend
        corner = (a[0], b[1]) if rng.random() < 0.5 else (b[0], a[1])
        for p, q in ((a, corner), (corner, b)):
            low = np.minimum(p, q) - (LANE - 1) // 2
            high = np.maximum(p, q) - (LANE - 1) // 2 + LANE
            free[low[0] : high[0], low[1] : high[1]] = True
    return GridScene(free, centres[0])


def _draw_room(rng: np.random.Generator, free: NDArray[np.bool_]) -> tuple[int, int]:
    """Clear a rectangle or an ellipse, two to six times as wide as a corridor; returns its centre."""
    half = rng.integers(LANE, 3 * LANE, 2, endpoint=True)
    middle = rng.integers(half + LANE, np.array(free.shape) - half - LANE)
    rows, cols = np.ogrid[: free.shape[0], : free.shape[1]]
    y, x = (rows - middle[0]) / half[0], (cols - middle[1]) / half[1]
    free |= (np.maximum(abs(x), abs(y)) <= 1) if rng.random() < 0.5 else (x**2 + y**2 <= 1)
    return int(middle[0]), int(middle[1])


class GridWorld:
    """The state of an exploration. The robot is a point on a lattice of nodes that includes its start.

    Attributes:
        belief: (H, W) uint8 known state of each cell: :data:`grid_kernels.IS_UNKNOWN`, ``IS_FREE`` or ``IS_WALL``.
        thinned: the same for squares with sides of ``rules.thinning`` cells.
        nodes: (N, 2) row and column of the cell of each node of the lattice.
        here: the robot's node.
        visited: (N,) whether the robot has looked from each node.
        way: distance driven, cells.
        moves: number of edges followed.
    """

    def __init__(self, scene: GridScene, rules: GridRules = PAPERS):
        """Begin at the scene's start, and look all around."""
        self.scene, self.rules = scene, rules
        self.belief = np.zeros(scene.free.shape, np.uint8)
        self.thinned = np.zeros(np.array(scene.free.shape) // rules.thinning, np.uint8)
        self._make_lattice()
        self.visited = np.zeros(len(self.nodes), np.bool_)
        self.way, self.moves = 0.0, 0
        self._unseen = int(scene.free.sum())
        self._look()

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
    def is_explored(self) -> bool:
        """Whether at most ``rules.most_unseen`` free cells are unseen."""
        return self._unseen <= self.rules.most_unseen

    def ways(self, start: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """(N,) lengths of the shortest known paths from a node, cells, and (N,) predecessor of each node, or -1."""
        ways, before = kernels.shortest_ways(self._neighbours, self._lengths, self._open, start)
        return ways, before

    def next_nodes(self, node: int) -> NDArray[np.int64]:
        """(K,) the neighbours of a node along known free edges."""
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
        self.way += float(np.linalg.norm(self.nodes[node] - self.nodes[self.here]))
        self.here, self.moves = node, self.moves + 1
        self._look()

    def reveal(self) -> None:
        """Reveal the whole map, for the oracle."""
        self.belief[:] = np.where(self.scene.free, kernels.IS_FREE, kernels.IS_WALL)
        self._update(np.zeros(2, np.int64), self.belief.size)

    def view(self, node: int) -> PixelMask:
        """(H, W) mask of what the sensor sees from a node."""
        belief, (row, col) = np.zeros_like(self.belief), self.nodes[node].tolist()
        kernels.sense(self.scene.free, belief, row, col, BEARINGS, self.rules.reach, self.rules.wall)
        return belief != kernels.IS_UNKNOWN

    def _look(self) -> None:
        """Add what the sensor sees to the belief."""
        rules, (row, col) = self.rules, self.nodes[self.here].tolist()
        self._unseen -= kernels.sense(self.scene.free, self.belief, row, col, BEARINGS, rules.reach, rules.wall)
        self.visited[self.here] = True
        self._update(np.array([row, col]), rules.reach + 1)

    def _update(self, middle: NDArray[np.int64], radius: int) -> None:
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
