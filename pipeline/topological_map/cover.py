"""Which nodes see which ground: the set that the nodes must cover."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.topological_map import sight_kernels as kernels
from pipeline.topological_map.ground import Ground


@dataclass(frozen=True, eq=False)
class Views:
    """What K places see.

    Attributes:
        places: (K, 2) m in ``map``.
        seen: (K, S, S) bool, cells of a square window around each place.
        corners: (K, 2) int64 grid indices of the windows' first cells.
    """

    places: NDArray[np.float64]
    seen: NDArray[np.bool_]
    corners: NDArray[np.int64]

    def __len__(self) -> int:
        """Number of places."""
        return len(self.places)

    def __getitem__(self, rows: slice | NDArray) -> "Views":
        """The views of some of the places."""
        return Views(self.places[rows], self.seen[rows], self.corners[rows])


class Cover:
    """The ground that nodes see, and how many see it.

    Attributes:
        ground: as last renewed.
        count: (nx, ny) int32, number of nodes that see each target cell.
    """

    def __init__(self, ground: Ground, sight: float):
        """``sight``: m, how far a node sees."""
        self.ground = ground
        self.count = np.zeros(ground.grid.shape, np.int32)
        self._reach = round(sight / ground.grid.cell)
        self._views: dict[int, Views] = {}

    def renewed(self, ground: Ground, changed: NDArray[np.bool_]) -> "Cover":
        """The same nodes' cover of changed ground; only those look again that had a changed cell in their window."""
        new = Cover(ground, self._reach * ground.grid.cell)
        shift = np.round((self.ground.grid.origin - ground.grid.origin) / ground.grid.cell).astype(np.int64)
        for node, viewpoint in self._views.items():
            corners = viewpoint.corners + shift
            if changed[new._window(corners[0])].any():
                new.add(node, viewpoint.places[0])
            else:
                new._insert(node, Views(viewpoint.places, viewpoint.seen, corners))
        return new

    @property
    def missing(self) -> NDArray[np.bool_]:
        """(nx, ny) target cells that no node sees."""
        return self.ground.target & (self.count == 0)

    def see(self, places: NDArray[np.float64]) -> Views:
        """What (K, 2) places see."""
        grid = self.ground.grid
        cells = np.ascontiguousarray((places - grid.origin) / grid.cell)
        seen, corners = kernels.viewpoints(cells, self.ground.target, self.ground.walls, self._reach)
        return Views(places, seen, corners)

    def add(self, node: int, place: NDArray[np.float64]) -> None:
        """Let a node at ``place`` (2,) see."""
        self._insert(node, self.see(place[None]))

    def remove(self, node: int) -> None:
        """Forget a node."""
        self._change(self._views.pop(node), -1)

    def gains(self, viewpoints: Views) -> NDArray[np.int64]:
        """(K,) how many cells each of the views would add."""
        return kernels.count_in(viewpoints.seen, viewpoints.corners, self.missing)

    def lost_without(self, nodes: Collection[int]) -> NDArray[np.int64]:
        """(M, 2) the cells that only these nodes see, outermost first."""
        for n in nodes:
            self._change(self._views[n], -1)
        lost = [self._unseen(self._views[n]) for n in nodes]
        for n in nodes:
            self._change(self._views[n], 1)
        cells = np.unique(np.concatenate(lost), axis=0)
        if not len(cells):
            return cells
        return cells[np.argsort(-np.linalg.norm(cells - cells.mean(axis=0), axis=1), kind="stable")]

    def see_all(self, viewpoints: Views, cells: NDArray[np.int64], spare: int) -> NDArray[np.bool_]:
        """(K,) which of the views hold all but ``spare`` of the cells (M, 2)."""
        return kernels.see_all(viewpoints.seen, viewpoints.corners, cells, spare)

    def is_near(self, node: int, mask: NDArray[np.bool_]) -> bool:
        """Whether a mask (nx, ny) has a cell in a node's window."""
        return bool(mask[self._window(self._views[node].corners[0])].any())

    def _insert(self, node: int, viewpoint: Views) -> None:
        self._views[node] = viewpoint
        self._change(viewpoint, 1)

    def _change(self, viewpoint: Views, by: int) -> None:
        window = self._window(viewpoint.corners[0])
        self.count[window] += by * viewpoint.seen[0][self._inside(viewpoint.corners[0], window)]

    def _unseen(self, viewpoint: Views) -> NDArray[np.int64]:
        """(M, 2) the cells of a view that no node sees."""
        window = self._window(viewpoint.corners[0])
        unseen = viewpoint.seen[0][self._inside(viewpoint.corners[0], window)] & (self.count[window] == 0)
        return np.argwhere(unseen) + np.array([w.start for w in window])

    def _window(self, corner: NDArray[np.int64]) -> tuple[slice, slice]:
        """The part of a window that lies on the grid."""
        size = 2 * self._reach + 1
        low = np.maximum(corner, 0)
        high = np.maximum(np.minimum(corner + size, self.ground.grid.shape), low)
        return slice(int(low[0]), int(high[0])), slice(int(low[1]), int(high[1]))

    @staticmethod
    def _inside(corner: NDArray[np.int64], window: tuple[slice, slice]) -> tuple[slice, ...]:
        """The same part in the window's own indices."""
        return tuple(slice(w.start - int(c), w.stop - int(c)) for w, c in zip(window, corner, strict=True))
