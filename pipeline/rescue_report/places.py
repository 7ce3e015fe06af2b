"""Groups cells of a grid into places that can be named and drawn."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.arrays import MaskLayer, Place
from pipeline.grid_map import Grid


@dataclass(frozen=True, eq=False)
class ReportedPlace:
    """A group of cells near each other.

    Attributes:
        position: centre of the cell nearest to the mean of all the cells.
        area: area of the cells, m².
        value: maximum of the cells' values.
    """

    position: Place
    area: float
    value: float


def places(grid: Grid, mask: MaskLayer, values: NDArray, apart: float) -> list[ReportedPlace]:
    """The places formed by the cells of a mask, sorted by value, the greatest first.

    Args:
        grid: grid of the cells.
        mask: the cells.
        values: (nx, ny) value of every cell.
        apart: distance below which cells belong to one place, m; adjacent cells always do.
    """
    reach = 1 + 2 * round(apart / grid.cell / 2)
    pieces, _ = ndimage.label(ndimage.maximum_filter(mask, reach), np.ones((3, 3)))
    pieces[~mask] = 0
    found = []
    for piece, box in enumerate(ndimage.find_objects(pieces), start=1):
        if box is None:
            continue
        cells = np.argwhere(pieces[box] == piece)
        middle = cells[np.linalg.norm(cells - cells.mean(axis=0), axis=1).argmin()]
        corner = [side.start for side in box]
        value = float(values[box][pieces[box] == piece].max())
        found.append(ReportedPlace(grid.centre_of(middle + corner), len(cells) * grid.cell**2, value))
    return sorted(found, key=lambda place: -place.value)
