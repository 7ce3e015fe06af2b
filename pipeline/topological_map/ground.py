"""What the topological map must know of the ground: what is to be seen, what hides it, where nodes may lie."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.grid_map import Grid, box_around
from pipeline.segments.cells import centres
from pipeline.segments.segments import Segment
from pipeline.traversability.traversability import Traversability

_TALL = 0.4
"""m above the ground around it; what is taller hides what is behind it, decks and ramps do not."""
_BLOCK = 4
"""Cells along each side of a block that has one candidate for a node."""


@dataclass(frozen=True, eq=False)
class Ground:
    """The drivable surface as nodes see it; all arrays are (nx, ny) bool on its grid.

    Attributes:
        traversability: what may be driven on.
        target: cells that the robot can reach, which nodes are to express.
        standable: cells of these where it can stand and turn.
        walls: cells that hide what is behind them.
    """

    traversability: Traversability
    target: NDArray[np.bool_]
    standable: NDArray[np.bool_]
    walls: NDArray[np.bool_]

    @classmethod
    def of(
        cls, traversability: Traversability, reachable: NDArray[np.bool_], walls: Sequence[Segment]
    ) -> "Ground":
        """The reachable ground; walls are the cells of these segments and all that stands tall."""
        return cls(
            traversability=traversability,
            target=traversability.traversable & reachable,
            standable=traversability.turnable & reachable,
            walls=_tall(traversability) | _cells(traversability.grid, walls),
        )

    @property
    def grid(self) -> Grid:
        """Where the cells lie."""
        return self.traversability.grid

    def changed_since(self, old: "Ground | None") -> NDArray[np.bool_]:
        """(nx, ny) the cells that are not what they were on a grid that may have been smaller."""
        if old is None:
            return np.ones(self.grid.shape, np.bool_)
        start = np.round((old.grid.origin - self.grid.origin) / self.grid.cell).astype(int)
        inside = tuple(slice(s, s + n) for s, n in zip(start, old.grid.shape, strict=True))
        changed = np.zeros(self.grid.shape, np.bool_)
        for now, before in (
            (self.target, old.target),
            (self.standable, old.standable),
            (self.walls, old.walls),
        ):
            difference = now.copy()
            difference[inside] ^= before
            changed |= difference
        return changed

    def candidates(self, mask: NDArray[np.bool_], within: float) -> NDArray[np.float64]:
        """(K, 2) m, places near a mask: of every block of standable cells the one farthest from hazards."""
        if not mask.any():
            return np.zeros((0, 2))
        # From one corner of a block on, to another where the grid allows.
        i, j = box_around(mask, round(within / self.grid.cell))
        window = slice(i.start // _BLOCK * _BLOCK, i.stop), slice(j.start // _BLOCK * _BLOCK, j.stop)
        near = ndimage.distance_transform_edt(~mask[window]) * self.grid.cell <= within
        room = np.where(near & self.standable[window], self.traversability.to_hazard[window], 0)
        blocks = _blocks(room)
        wanted = blocks.any(axis=2)
        best = np.stack(np.divmod(blocks.argmax(axis=2)[wanted], _BLOCK), axis=-1)
        corner = (window[0].start, window[1].start)
        return self.grid.centre_of(np.argwhere(wanted) * _BLOCK + best + corner)


def _blocks(layer: NDArray) -> NDArray:
    """(⌈nx / B⌉, ⌈ny / B⌉, B²) the cells of every block of a layer, 0 beyond its end."""
    layer = np.pad(layer, [(0, -n % _BLOCK) for n in layer.shape])
    nx, ny = np.array(layer.shape) // _BLOCK
    return layer.reshape(nx, _BLOCK, ny, _BLOCK).swapaxes(1, 2).reshape(nx, ny, -1)


def _tall(traversability: Traversability) -> NDArray[np.bool_]:
    known = np.where(np.isnan(traversability.elevation), np.inf, traversability.elevation)
    return traversability.hazard & (traversability.elevation > ndimage.minimum_filter(known, 5) + _TALL)


def _cells(grid: Grid, segments: Sequence[Segment]) -> NDArray[np.bool_]:
    """The cells over which surfaces were seen."""
    mask = np.zeros(grid.shape, np.bool_)
    for segment in segments:
        cells = grid.cell_of(centres(segment.cells))
        inside = ((cells >= 0) & (cells < grid.shape)).all(axis=1)
        mask[cells[inside, 0], cells[inside, 1]] = True
    return mask
