"""Regular grids over the xy plane of ``map``: the position of cells, and named layers that grow and track changes."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, reduce
from math import prod
from types import EllipsisType
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray
from scipy import ndimage

from pipeline.arrays import Boxes, Cells, Mask, MaskLayer, Place
from pipeline.errors import InputError
from pipeline.files import MAX_MEMORY

CellWindow = tuple[slice, slice]  # A rectangle of grid cells

BLOCK = 64
"""Side of the blocks in which maps grow, cells or voxels: 3.2 m with 5 cm cells."""
BORDER = 20
"""Margin of the grid around the points, cells, so that the points' surroundings can be searched: 1 m with 5 cm
cells."""


@dataclass(frozen=True, eq=False)
class Grid:
    """The position of a layer's cells; layers are indexed [i, j] along x and y.

    Every cell also has absolute indices, which stay the same when the grid grows: the cell (i, j) covers
    [i·cell, (i + 1)·cell) m along x and [j·cell, (j + 1)·cell) m along y. Its element in a layer is [i, j] - ``low``.

    Attributes:
        low: (2,) int64 absolute indices of the element [0, 0].
        cell: side of a cell, m.
        shape: number of cells along x and y.
    """

    low: NDArray[np.int64]
    cell: float
    shape: tuple[int, int]

    @classmethod
    def around(cls, boxes: Boxes, cell: float) -> Self:
        """The grid of all cells of side ``cell`` m that the boxes (M, 2, 3), m, touch, plus one cell on each side."""
        low, high = (
            np.floor(corner[:2] / cell).astype(np.int64) for corner in (boxes.min((0, 1)), boxes.max((0, 1)))
        )
        nx, ny = (high - low + 3).tolist()
        return cls(low - 1, cell, (nx, ny))

    @cached_property
    def origin(self) -> Place:
        """x and y of the lower corner of the element [0, 0], m."""
        return np.asarray(self.low * self.cell, np.float64)

    def cell_of(self, xy: ArrayLike) -> NDArray[np.int64]:
        """(..., 2) indices of the elements that contain points (..., 2 or 3), m; may lie outside the grid."""
        return np.floor((np.asarray(xy)[..., :2] - self.origin) / self.cell).astype(np.int64)

    def centre_of(self, cells: ArrayLike) -> NDArray[np.float64]:
        """(..., 2) centres, m, of elements with indices (..., 2)."""
        return self.origin + (np.asarray(cells) + 0.5) * self.cell

    def holds(self, cells: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(...) whether elements with indices (..., 2) lie on the grid."""
        return np.asarray(((cells >= 0) & (cells < self.shape)).all(axis=-1))

    def at(self, layer: NDArray, xy: ArrayLike, outside: float = 0) -> NDArray:
        """(...) values of a layer at points (..., 2 or 3), m; ``outside`` beyond the grid."""
        cells = self.cell_of(xy)
        inside = self.holds(cells)
        cells = np.where(np.expand_dims(inside, -1), cells, 0)
        return np.where(inside, layer[cells[..., 0], cells[..., 1]], layer.dtype.type(outside))

    def mask_of(self, xy: ArrayLike) -> MaskLayer:
        """The cells that contain points (N, 2 or 3), m; points outside the grid are ignored."""
        cells = self.cell_of(xy)
        i, j = cells[self.holds(cells)].T
        mask = np.zeros(self.shape, np.bool_)
        mask[i, j] = True
        return mask

    def touched_by(self, boxes: Boxes) -> tuple[MaskLayer, Callable[[Boxes], Mask]]:
        """The cells touched by boxes (M, 2, 3), m, and a function that returns which other boxes touch them."""
        mask = np.zeros(self.shape, np.bool_)
        for (i, j), (k, m) in self.cell_of(boxes):
            mask[i : k + 1, j : m + 1] = True
        before = np.pad(mask.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
        first_end = np.array([[0], [1]])

        def meets(others: Boxes) -> Mask:
            (i, j), (k, m) = (self.cell_of(others) + first_end).clip(0, self.shape).transpose(1, 2, 0)
            return np.asarray(before[k, m] - before[i, m] - before[k, j] + before[i, j] > 0)

        return mask, meets

    def distance_to(self, mask: MaskLayer) -> NDArray[np.float64]:
        """(nx, ny) m, distance from each cell's centre to the nearest centre in the mask; inf for an empty mask."""
        if not mask.any():
            # For an empty mask, SciPy would measure from a point next to the first cell.
            return np.full(mask.shape, np.inf)
        distance: NDArray[np.float64] = ndimage.distance_transform_edt(~mask) * self.cell
        return distance

    def nearest(self, mask: MaskLayer, xy: ArrayLike, within: float) -> Place | None:
        """The point itself if its cell is in the mask, otherwise the centre of the nearest cell of the mask.

        None if the mask has no cell at most ``within`` m away.
        """
        xy = np.asarray(xy, np.float64)[:2]
        if self.at(mask, xy, outside=0):
            return xy
        reach = int(np.ceil(within / self.cell))
        low, high = np.maximum(self.cell_of(xy) - reach, 0), np.maximum(self.cell_of(xy) + reach + 1, 0)
        centres = self.centre_of(np.argwhere(mask[low[0] : high[0], low[1] : high[1]]) + low)
        distance = np.linalg.norm(centres - xy, axis=1)
        return centres[distance.argmin()] if len(distance) and distance.min() <= within else None

    def part(self, box: CellWindow) -> "Grid":
        """The grid that consists of the cells in a box."""
        i, j = (s.indices(n) for s, n in zip(box, self.shape, strict=True))
        return Grid(self.low + np.array([i[0], j[0]]), self.cell, (i[1] - i[0], j[1] - j[0]))

    def box_of(self, part: "Grid") -> CellWindow:
        """The box that another grid of the same cells covers; that grid must lie entirely within this grid."""
        i, j = (slice(int(s), int(s) + n) for s, n in zip(part.low - self.low, part.shape, strict=True))
        return i, j

    def widened(self, xy: NDArray[np.float64], margin: float) -> "Grid":
        """The smallest grid that contains this grid and everything within ``margin`` m of points (N, 2), m."""
        reach = int(np.ceil(margin / self.cell))
        cells = self.low + np.vstack([self.cell_of(xy) - reach, self.cell_of(xy) + reach + 1, [(0, 0)], [self.shape]])
        low, high = cells.min(axis=0), cells.max(axis=0)
        return Grid(low, self.cell, (int(high[0] - low[0]), int(high[1] - low[1])))

    def is_same(self, other: "Grid") -> bool:
        """Whether another grid has exactly the same cells."""
        return self.cell == other.cell and self.shape == other.shape and bool((self.low == other.low).all())


@dataclass(frozen=True)
class LayerType:
    """The type of a layer's cells.

    Attributes:
        dtype: type of the values.
        fill: value of an unknown cell.
        per_cell: shape of a cell's value; () is a single number.
        in_place: whether the owner changes the array itself; the array is then neither copied nor tracked.
    """

    dtype: DTypeLike
    fill: float = 0
    per_cell: tuple[int, ...] = ()
    in_place: bool = False

    @property
    def bytes_per_cell(self) -> int:
        """Bytes per cell, including the revision of its last change."""
        return np.dtype(self.dtype).itemsize * prod(self.per_cell) + (0 if self.in_place else np.int32().itemsize)

    def array(self, shape: tuple[int, int]) -> NDArray:
        """(nx, ny, ...) array in which all cells are unknown."""
        return np.full((*shape, *self.per_cell), self.fill, self.dtype)


class GridMap:
    """Named layers on one growing grid; outside the grid, every cell has its layer's ``fill`` value.

    A layer is copied before a write, so arrays that were handed out never change, except arrays of layers that are
    changed in place.

    Attributes:
        grid: the current grid.
        revision: number of times that the grid has grown or a write has changed a value.
    """

    def __init__(self, cell: float, layers: Mapping[str, LayerType]):
        """Start without cells; ``cell``: cell size, m."""
        self.grid = Grid(np.zeros(2, np.int64), cell, (0, 0))
        self.revision = 0
        self._kinds = dict(layers)
        self._layers = {name: kind.array((0, 0)) for name, kind in layers.items()}
        self._stamps = {name: np.zeros((0, 0), np.int32) for name, kind in layers.items() if not kind.in_place}

    def __getitem__(self, name: str) -> NDArray:
        """(nx, ny, ...) the current values of a layer."""
        return self._layers[name]

    def cover(self, xy: NDArray) -> None:
        """Grow by whole blocks until all cells within ``BORDER`` of points (N, 2 or 3), m, lie on the grid.

        Raises:
            InputError: the grid would take too much memory. The grid is unchanged.
        """
        corners = self.grid.cell_of(np.stack([xy.min(axis=0), xy.max(axis=0)])) + np.array([[-BORDER], [BORDER]])
        if self.grid.holds(corners).all():
            return
        first, last = self.grid.low + corners
        self._grow(first // BLOCK * BLOCK, (last // BLOCK + 1) * BLOCK)

    def match(self, grid: Grid) -> None:
        """Grow until the grid contains another grid of the same cells."""
        self._grow(grid.low, grid.low + grid.shape)

    def write(self, name: str, values: ArrayLike, where: CellWindow | NDArray | tuple | EllipsisType = ...) -> None:
        """Set a layer (nx, ny), or only the cells that the index ``where`` selects."""
        old = self._layers[name]
        values = np.asarray(values, old.dtype)
        # Compare bits, so that NaN equals NaN.
        differs = _bits(old[where]) != _bits(values)
        for _ in self._kinds[name].per_cell:
            # This is several times faster than any() along a short last axis.
            differs = reduce(np.logical_or, np.moveaxis(differs, -1, 0))
        if not differs.any():
            return
        self.revision += 1
        self._layers[name] = old.copy()
        self._layers[name][where] = values
        stamps = self._stamps[name]
        stamps[where] = np.where(differs, self.revision, stamps[where])

    def changed_since(self, revision: int, *names: str) -> MaskLayer:
        """The cells that have changed since a revision in any of the named layers, or in any layer if none is named.

        Cells that the grid has gained since then are included only if they were written.
        """
        stamps = [self._stamps[name] for name in names or self._stamps]
        return reduce(np.maximum, stamps) > revision

    def _grow(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> None:
        """Grow to contain the cells from ``low`` (inclusive) to ``high`` (exclusive), (2,) absolute indices."""
        old = self.grid
        if all(old.shape):
            low, high = np.minimum(low, old.low), np.maximum(high, old.low + old.shape)
        nx, ny = (high - low).tolist()
        if (nx, ny) == old.shape:
            return
        per_cell = sum(kind.bytes_per_cell for kind in self._kinds.values())
        check_memory(f"a map of {nx * old.cell:.0f} × {ny * old.cell:.0f} m", nx * ny * per_cell)
        self.grid = Grid(low, old.cell, (nx, ny))
        self.revision += 1
        for name, kind in self._kinds.items():
            self._layers[name] = _grown(self._layers[name], kind.array((nx, ny)), self.grid.box_of(old))
        for name, stamps in self._stamps.items():
            self._stamps[name] = _grown(stamps, np.zeros((nx, ny), np.int32), self.grid.box_of(old))


def check_memory(name: str, size: int) -> None:
    """Raise InputError if an allocation of ``size`` bytes would exceed ``MAX_MEMORY``."""
    if size > MAX_MEMORY:
        raise InputError(f"{name} would take {size / 1e9:.3g} GB; the limit is {MAX_MEMORY / 1e9:.3g} GB")


def _bits(values: NDArray) -> NDArray:
    """The bits of the values as integers of the same shape, so that NaN equals NaN."""
    return values.view(f"u{values.itemsize}")


def _grown(values: NDArray, layer: NDArray, box: CellWindow) -> NDArray:
    """The larger ``layer`` with the old ``values`` in its ``box``."""
    layer[box] = values
    return layer


def blocks(layer: NDArray, size: int) -> NDArray:
    """(B², ⌈nx / B⌉, ⌈ny / B⌉) values of a layer in blocks of B × B cells, where B is ``size``, padded with 0."""
    layer = np.pad(layer, [(0, -n % size) for n in layer.shape])
    nx, ny = np.array(layer.shape) // size
    return layer.reshape(nx, size, ny, size).transpose(1, 3, 0, 2).reshape(-1, nx, ny)


def best_of_blocks(worth: NDArray, size: int) -> Cells:
    """Indices of the cell with the greatest positive ``worth`` (nx, ny) in each block of ``size``² cells."""
    parts = blocks(worth, size)
    best, wanted = parts.argmax(axis=0), parts.max(axis=0) > 0
    return np.argwhere(wanted) * size + np.stack(np.divmod(best[wanted], size), axis=1)


def box_around(mask: MaskLayer, margin: int) -> CellWindow:
    """The bounding box of a non-empty mask, enlarged by ``margin`` cells where the grid allows."""
    slices = []
    for axis in (0, 1):
        hit = np.flatnonzero(mask.any(axis=1 - axis))
        slices.append(slice(max(0, hit[0] - margin), min(mask.shape[axis], hit[-1] + margin + 1)))
    return slices[0], slices[1]


def relative_to(inner: CellWindow, outer: CellWindow) -> CellWindow:
    """The box ``inner`` in indices relative to the first corner of the box ``outer``, which contains it."""
    i, j = (slice(a.start - b.start, a.stop - b.start) for a, b in zip(inner, outer, strict=True))
    return i, j


def ensure_capacity(values: NDArray, size: int, more: int) -> NDArray:
    """The array if it has room for ``more`` rows after the first ``size``, else a copy of 2ⁿ rows, padded with 0."""
    if size + more <= len(values):
        return values
    result = np.zeros((1 << (size + more).bit_length(), *values.shape[1:]), values.dtype)
    result[:size] = values[:size]
    return result
