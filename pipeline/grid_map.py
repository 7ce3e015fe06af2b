"""A regular grid over the xy plane of ``map``."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage


@dataclass(frozen=True, eq=False)
class Grid:
    """Where the cells of a layer lie; layers are indexed [i, j] along x and y.

    Attributes:
        origin: (2,) xy of the corner of cell [0, 0], m.
        cell: side of a cell, m.
        shape: number of cells along x and y.
    """

    origin: NDArray[np.float64]
    cell: float
    shape: tuple[int, int]

    def cell_of(self, xy: ArrayLike) -> NDArray[np.int64]:
        """(..., 2) indices of the cells that hold the points (..., 2 or 3); may lie outside the grid."""
        return np.floor((np.asarray(xy)[..., :2] - self.origin) / self.cell).astype(np.int64)

    def centre_of(self, cells: ArrayLike) -> NDArray[np.float64]:
        """(..., 2) centres of cells (..., 2), m."""
        return self.origin + (np.asarray(cells) + 0.5) * self.cell

    def at(self, layer: NDArray, xy: ArrayLike, outside: float = 0) -> NDArray:
        """(...) values of a layer at points (..., 2 or 3); ``outside`` beyond the grid."""
        cells = self.cell_of(xy)
        inside = ((cells >= 0) & (cells < self.shape)).all(axis=-1)
        cells = np.where(np.expand_dims(inside, -1), cells, 0)
        return np.where(inside, layer[cells[..., 0], cells[..., 1]], layer.dtype.type(outside))

    def distance_to(self, mask: NDArray[np.bool_]) -> NDArray[np.float64]:
        """(nx, ny) m from every cell to the nearest of the mask, from centre to centre; infinite if it is empty."""
        if not mask.any():
            # SciPy would measure from a place beside the first cell.
            return np.full(mask.shape, np.inf)
        distance: NDArray[np.float64] = ndimage.distance_transform_edt(~mask) * self.cell
        return distance

    def nearest(self, mask: NDArray[np.bool_], xy: ArrayLike, within: float) -> NDArray[np.float64] | None:
        """(2,) the point itself if its cell is in the mask, or else the centre of the nearest such cell.

        None if there is none ``within`` so many metres.
        """
        xy = np.asarray(xy, np.float64)[:2]
        if self.at(mask, xy, outside=0):
            return xy
        reach = int(np.ceil(within / self.cell))
        low, high = np.maximum(self.cell_of(xy) - reach, 0), np.maximum(self.cell_of(xy) + reach + 1, 0)
        centres = self.centre_of(np.argwhere(mask[low[0] : high[0], low[1] : high[1]]) + low)
        distance = np.linalg.norm(centres - xy, axis=1)
        return centres[distance.argmin()] if len(distance) and distance.min() <= within else None


def box_around(mask: NDArray[np.bool_], margin: int) -> tuple[slice, slice]:
    """The bounding box of a mask (nx, ny) that is not empty, ``margin`` cells larger where the grid allows."""
    slices = []
    for axis in (0, 1):
        hit = np.flatnonzero(mask.any(axis=1 - axis))
        slices.append(slice(max(0, hit[0] - margin), min(mask.shape[axis], hit[-1] + margin + 1)))
    return slices[0], slices[1]


def inside(inner: tuple[slice, slice], outer: tuple[slice, slice]) -> tuple[slice, slice]:
    """A box as seen from the first corner of another one that holds it."""
    i, j = (slice(a.start - b.start, a.stop - b.start) for a, b in zip(inner, outer, strict=True))
    return i, j
