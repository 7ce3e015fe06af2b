"""Portals of an arena: doorways and junctions of the free space, which score once they are on the map."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.arrays import MaskLayer, Places
from sarsim.ground_truth.true_surface import CELL, GroundTruthSurface
from sarsim.plugins.league.portals_kernels import edge_cells

DOOR_WIDTH = 0.9  # m, width of the leagues' doors
MIN_CORRIDOR_WIDTH = 1.2  # m, minimum width of the leagues' corridors
EIGHT_NEIGHBOURS = np.ones((3, 3), np.bool_)
RING = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))  # Steps to the neighbours, as a ring


def portals(surface: GroundTruthSurface, clearance: float) -> Places:
    """(N, 2) m in ``world``, doorways and junctions of the ground between the walls; other obstacles are ignored.

    Args:
        surface: the true ground.
        clearance: minimum distance of the robot's centre from walls, m.
    """
    free = _between_walls(surface, clearance)
    cells = [*_doorways(free, (DOOR_WIDTH + MIN_CORRIDOR_WIDTH) / 4 - clearance), *_junctions(free)]
    return surface.grid.centre_of(np.array(cells).reshape(-1, 2))


def _between_walls(surface: GroundTruthSurface, clearance: float) -> MaskLayer:
    """The cells farther than ``clearance`` m from walls and connected to drivable cells, even across obstacles."""
    near = surface.grid.distance_to(surface.walls) <= clearance
    free = ndimage.binary_fill_holes(near | np.isfinite(surface.height)) & ~near
    pieces, _ = ndimage.label(free, EIGHT_NEIGHBOURS)
    return np.asarray(free & np.isin(pieces, np.unique(pieces[surface.drivable])))


def _doorways(free: NDArray[np.bool_], narrow: float) -> list[NDArray[np.int64]]:
    """(2,) cells in the middle of passages at most ``narrow`` m wide to each side, with wider ground at both ends.

    A doorway is a region that a morphological opening with a disc removes, and that touches the remaining regions in
    at least two places (morphological room segmentation, Bormann et al. 2016).
    """
    inside = np.pad(free, 1)
    wide = ndimage.distance_transform_edt(inside)[1:-1, 1:-1] * CELL > narrow
    opened = free & (ndimage.distance_transform_edt(~wide) * CELL <= narrow) if wide.any() else wide
    passages, count = ndimage.label(free & ~opened, EIGHT_NEIGHBOURS)
    doors = []
    for number in range(1, count + 1):
        passage = passages == number
        _, ends = ndimage.label(ndimage.binary_dilation(passage, EIGHT_NEIGHBOURS) & opened, EIGHT_NEIGHBOURS)
        if ends >= 2:
            doors.append(_middle(passage))
    return doors


def _junctions(free: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    """(2,) cells of the skeleton where three or more branches meet; of several such cells near each other, only one.

    A branch is counted only if it leaves the square around the largest free disc at the cell, because branches also
    lead into the square's corners.
    """
    thin = skeleton(free)
    reach = np.sqrt(2) * ndimage.distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1] + 1
    cells = np.argwhere(thin & (_crossings(_neighbours(thin)) >= 3))
    found: list[NDArray[np.int64]] = []
    for cell in cells[np.argsort(-reach[tuple(cells.T)], kind="stable")]:
        is_new = all(np.linalg.norm(cell - other) > reach[tuple(other)] for other in found)
        found += [cell] if is_new and _branch_count(thin, cell, float(reach[tuple(cell)])) >= 3 else []
    return found


def _branch_count(thin: NDArray[np.bool_], cell: NDArray[np.int64], reach: float) -> int:
    """Number of branches of a skeleton that extend farther than ``reach`` cells from a cell (2,)."""
    low = np.maximum(cell - int(reach) - 3, 0)
    thin, cell = thin[tuple(map(slice, low, cell + int(reach) + 4))], cell - low
    distance = np.linalg.norm(np.indices(thin.shape) - cell[:, None, None], axis=0)
    pieces, _ = ndimage.label(thin & (distance <= reach + 2), EIGHT_NEIGHBOURS)
    return int(ndimage.label((pieces == pieces[tuple(cell)]) & (distance > reach), EIGHT_NEIGHBOURS)[1])


def _middle(mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(2,) the cell of a mask nearest to the mask's centroid."""
    cells = np.argwhere(mask)
    nearest: NDArray[np.int64] = cells[np.linalg.norm(cells - cells.mean(axis=0), axis=1).argmin()]
    return nearest


def _neighbours(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(8, nx, ny) values of a mask (nx, ny) at the neighbours of each cell, in the order of ``RING``."""
    padded = np.pad(mask, 1)
    nx, ny = mask.shape
    return np.stack([padded[1 + i : 1 + i + nx, 1 + j : 1 + j + ny] for i, j in RING])


def _crossings(around: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(nx, ny) number of changes from outside to inside along the ring of neighbours (8, nx, ny) of each cell."""
    return np.asarray((~around & np.roll(around, -1, axis=0)).sum(axis=0), np.int64)


def skeleton(mask: MaskLayer) -> MaskLayer:
    """The skeleton of a mask: lines one cell wide, obtained by thinning (Zhang and Suen 1984)."""
    thin, changes, ring = mask.copy(), True, np.array(RING)
    while changes:
        changes = False
        for sides in (((0, 2, 4), (2, 4, 6)), ((0, 2, 6), (0, 4, 6))):
            goes = edge_cells(thin, ring, *map(np.array, sides))
            thin &= ~goes
            changes |= bool(goes.any())
    return thin
