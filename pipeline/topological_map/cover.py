"""The ground that the nodes are to see: what of it they see, what hides it, and where they may lie."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.grid_map import Box, Grid, GridMap, Layer, blocks, box_around
from pipeline.segments.cells import centres
from pipeline.segments.segments import Segment
from pipeline.topological_map import sight_kernels as kernels
from pipeline.traversability.elevation_map import CELL
from pipeline.traversability.traversability import Traversability

SIGHT = 2.0
"""m from which a node covers the ground that it sees."""
_REACH = round(SIGHT / CELL)
_BLOCK = 4
"""Cells along each side of a block that has one candidate for a node."""


@dataclass(frozen=True, eq=False)
class VisibleCells:
    """What K places see.

    Attributes:
        places: (K, 2) m in ``map``.
        seen: (K, S, S) bool, cells of a square window around each place.
        corners: (K, 2) int64 absolute indices of the windows' first cells.
    """

    places: NDArray[np.float64]
    seen: NDArray[np.bool_]
    corners: NDArray[np.int64]


class Cover:
    """A grid map of the ground that nodes are to see, and how many see it.

    Attributes:
        traversability: as of the last update.
    """

    traversability: Traversability

    def __init__(self) -> None:
        mask = Layer(np.bool_)
        count, left = Layer(np.int32, in_place=True), Layer(np.bool_, in_place=True)
        self._layers = GridMap(CELL, {"target": mask, "standable": mask, "walls": mask, "count": count, "left": left})
        self._seen_by: dict[int, VisibleCells] = {}

    def update(
        self, traversability: Traversability, reachable: NDArray[np.bool_], walls: Sequence[Segment]
    ) -> NDArray[np.bool_]:
        """Follow the ground; only those nodes look again in whose window a cell changed.

        Args:
            traversability: what may be driven on.
            reachable: (nx, ny) where the robot can go: what nodes are to see.
            walls: they hide what is behind them, and so does all that stands tall.

        Returns:
            (nx, ny) bool, the cells that changed.
        """
        self.traversability = traversability
        layers, revision = self._layers, self._layers.revision
        layers.match(traversability.grid)
        layers.write("target", traversability.traversable & reachable)
        layers.write("standable", traversability.turnable & reachable)
        in_walls = np.vstack([np.zeros((0, 3)), *(centres(wall.cells) for wall in walls)])
        layers.write("walls", traversability.tall | self.grid.mask_of(in_walls))
        changed = layers.changed_since(revision)
        if changed.any():
            layers["left"][box_around(changed, 2 * _REACH)] = False
        for node, visible in list(self._seen_by.items()):
            if changed[self._window(visible)].any():
                self.remove(node)
                self.add(node, visible.places[0])
        return changed

    @property
    def grid(self) -> Grid:
        """Where the cells lie."""
        return self._layers.grid

    @property
    def target(self) -> NDArray[np.bool_]:
        """(nx, ny) cells that the robot can reach, which nodes are to see."""
        return self._layers["target"]

    @property
    def standable(self) -> NDArray[np.bool_]:
        """(nx, ny) cells of these where it can stand and turn."""
        return self._layers["standable"]

    @property
    def count(self) -> NDArray[np.int32]:
        """(nx, ny) number of nodes that see each target cell."""
        return self._layers["count"]

    @property
    def missing(self) -> NDArray[np.bool_]:
        """(nx, ny) target cells that no node sees."""
        return self.target & (self.count == 0)

    @property
    def wanted(self) -> NDArray[np.bool_]:
        """(nx, ny) these, but for what was left as not worth a node, with the ground around it as it is."""
        return self.missing & ~self._layers["left"]

    def leave_rest(self) -> None:
        """What no node sees is not worth one."""
        self._layers["left"][:] = self.missing

    def visible_from(self, places: NDArray[np.float64]) -> VisibleCells:
        """What (K, 2) places, m, see."""
        cells = self.grid.cell_of(places)
        seen = kernels.visible_cells(cells, self.target, self._layers["walls"], ray_tree(_REACH), _REACH)
        return VisibleCells(places, seen, cells - _REACH + self.grid.low)

    def add(self, node: int, place: NDArray[np.float64]) -> None:
        """Let a node at ``place`` (2,), m, see."""
        self._seen_by[node] = self.visible_from(place[None])
        self._count(node, 1)

    def remove(self, node: int) -> None:
        """Forget a node."""
        self._count(node, -1)
        del self._seen_by[node]

    def gains(self, visible: VisibleCells) -> NDArray[np.int64]:
        """(K,) how many cells each of the places would add."""
        return kernels.count_in(visible.seen, visible.corners - self.grid.low, self.missing)

    def lost_without(self, nodes: Collection[int]) -> NDArray[np.int64]:
        """(M, 2) the cells that only these nodes see, outermost first."""
        for n in nodes:
            self._count(n, -1)
        lost = [self._unseen(self._seen_by[n]) for n in nodes]
        for n in nodes:
            self._count(n, 1)
        flat = np.unique(np.ravel_multi_index(tuple(np.concatenate(lost).T), self.grid.shape))
        cells = np.stack(np.unravel_index(flat, self.grid.shape), axis=1)
        if not len(cells):
            return cells
        return cells[np.argsort(-np.linalg.norm(cells - cells.mean(axis=0), axis=1), kind="stable")]

    def see_all(self, visible: VisibleCells, cells: NDArray[np.int64], spare: int) -> NDArray[np.bool_]:
        """(K,) which of the places see all but ``spare`` of the cells (M, 2)."""
        return kernels.see_all(visible.seen, visible.corners - self.grid.low, cells, spare)

    def is_near(self, node: int, mask: NDArray[np.bool_]) -> bool:
        """Whether a mask (nx, ny) has a cell in a node's window."""
        return bool(mask[self._window(self._seen_by[node])].any())

    def candidates(self, mask: NDArray[np.bool_], within: float) -> NDArray[np.float64]:
        """(K, 2) m, places near a mask: of every block of standable cells the one farthest from hazards."""
        if not mask.any():
            return np.zeros((0, 2))
        # From one corner of a block on, to another where the grid allows.
        i, j = box_around(mask, round(within / CELL))
        window = slice(i.start // _BLOCK * _BLOCK, i.stop), slice(j.start // _BLOCK * _BLOCK, j.stop)
        near = ndimage.distance_transform_edt(~mask[window]) * CELL <= within
        room = np.where(near & self.standable[window], self.traversability.to_hazard[window], 0)
        by_block = blocks(room, _BLOCK)
        wanted = by_block.any(axis=2)
        best = np.stack(np.divmod(by_block.argmax(axis=2)[wanted], _BLOCK), axis=-1)
        corner = (window[0].start, window[1].start)
        return self.grid.centre_of(np.argwhere(wanted) * _BLOCK + best + corner)

    def _count(self, node: int, by: int) -> None:
        """Let so many more nodes see what this one sees."""
        visible = self._seen_by[node]
        self.count[self._window(visible)] += by * self._on_grid(visible)

    def _unseen(self, visible: VisibleCells) -> NDArray[np.int64]:
        """(M, 2) the cells that a place sees and no node does."""
        window = self._window(visible)
        unseen = self._on_grid(visible) & (self.count[window] == 0)
        return np.argwhere(unseen) + np.array([w.start for w in window])

    def _window(self, visible: VisibleCells) -> Box:
        """The part of a place's window that lies on the grid."""
        corner = visible.corners[0] - self.grid.low
        low = np.maximum(corner, 0)
        high = np.maximum(np.minimum(corner + 2 * _REACH + 1, self.grid.shape), low)
        return slice(int(low[0]), int(high[0])), slice(int(low[1]), int(high[1]))

    def _on_grid(self, visible: VisibleCells) -> NDArray[np.bool_]:
        """(I, J) what a place sees in that part."""
        corner = visible.corners[0] - self.grid.low
        i, j = (slice(w.start - c, w.stop - c) for w, c in zip(self._window(visible), corner, strict=True))
        return visible.seen[0][i, j]


@cache
def ray_tree(reach: int) -> NDArray[np.int16]:
    """(N, 3) the cells on rays from a cell's middle to all cells on the rim of a square, ``reach`` cells away.

    Each by its offset and the number of the next entry that does not lie behind it, where to go on if a wall hides
    it. Rays that begin alike share their first entries.
    """
    across = np.arange(-reach, reach + 1)
    sides = [np.stack([across, np.full_like(across, end)], axis=1) for end in (-reach, reach)]
    rim = np.vstack([*sides, *(side[:, ::-1] for side in sides)])
    steps = np.arange(2 * reach + 2) / 2
    rays = np.floor(0.5 + steps[:, None] * (rim / np.linalg.norm(rim, axis=1)[:, None])[:, None]).astype(int)
    root: dict = {}
    for ray in rays.tolist():
        behind = root
        for i, j in dict.fromkeys(map(tuple, ray)):
            if i * i + j * j <= reach * reach:
                behind = behind.setdefault((i, j), {})
    entries: list[list[int]] = []

    def add(behind: dict) -> None:
        for cell, farther in behind.items():
            entry = [*cell, 0]
            entries.append(entry)
            add(farther)
            entry[2] = len(entries)

    add(root)
    return np.array(entries, np.int16)
