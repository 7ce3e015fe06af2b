"""Coordinates of a drawing from above: x to the right, y up."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.grid_map import Grid

EXTENT = 1000.0
"""Units, width and height into which the drawing fits, unless the arena is so large that a metre would be narrower
than a symbol."""
SYMBOL = 30.0
"""Units, the width of symbols."""
BORDER = 0.4
"""m around the known cells."""


class Paper:
    """Converts m in ``map`` to units of the drawing, which shows a window of a grid.

    Attributes:
        window: rows and columns of the grid.
        low: (2,) m, the window's lower left corner.
        scale: units per m.
        width, height: of the drawing, units.
        cell: units along a cell of the grid.
    """

    def __init__(self, grid: Grid, known: NDArray[np.bool_]):
        """A drawing with room for the cells that are ``known`` (nx, ny), or for all cells if none is."""
        cells = np.argwhere(known) if known.any() else np.array([[0, 0], np.subtract(grid.shape, 1)])
        margin = round(BORDER / grid.cell)
        low = np.maximum(cells.min(axis=0) - margin, 0)
        high = np.minimum(cells.max(axis=0) + 1 + margin, grid.shape)
        self.window = slice(low[0], high[0]), slice(low[1], high[1])
        self.low = grid.origin + low * grid.cell
        width, height = (high - low) * grid.cell
        self.scale = float(max(EXTENT / max(width, height), SYMBOL))
        self.width, self.height = float(width * self.scale), float(height * self.scale)
        self.cell = grid.cell * self.scale

    def __call__(self, xy: ArrayLike) -> NDArray[np.float64]:
        """(..., 2) units of points (..., 2 or 3), m in ``map``."""
        x, y = np.moveaxis((np.asarray(xy, np.float64)[..., :2] - self.low) * self.scale, -1, 0)
        return np.stack([x, self.height - y], axis=-1).round(1)
