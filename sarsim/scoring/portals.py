"""Portals of an arena: doorways and junctions of the free space, which count once they are on the map."""

from functools import reduce

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from sarsim.ground_truth.true_surface import CELL, TrueSurface

DOOR = 0.9  # m, width of the leagues' doors
CORRIDOR = 1.2  # m, least width of their corridors
SPUR = 0.6  # m; a shorter branch of the skeleton leads into a corner of a corridor, not along one
EIGHT = np.ones((3, 3), np.bool_)
RING = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))  # Steps to the neighbours, around


def portals(surface: TrueSurface, clearance: float) -> NDArray[np.float64]:
    """(N, 2) m, the doorways and junctions of the drivable ground.

    Args:
        surface: the true ground.
        clearance: m that the robot's middle keeps from obstacles, so by how much drivable ground is narrower.
    """
    free = surface.drivable
    cells = [*_doorways(free, (DOOR + CORRIDOR) / 4 - clearance), *_junctions(free)]
    return surface.grid.centre_of(np.array(cells).reshape(-1, 2))


def _doorways(free: NDArray[np.bool_], narrow: float) -> list[NDArray[np.int64]]:
    """(2,) cells in the middle of passages at most ``narrow`` m to each side, with wider ground at both ends.

    What an opening by a disc removes and what touches the rest twice is a doorway (morphological room segmentation,
    Bormann et al. 2016).
    """
    inside = np.pad(free, 1)
    wide = ndimage.distance_transform_edt(inside)[1:-1, 1:-1] * CELL > narrow
    opened = free & (ndimage.distance_transform_edt(~wide) * CELL <= narrow) if wide.any() else wide
    passages, count = ndimage.label(free & ~opened, EIGHT)
    doors = []
    for number in range(1, count + 1):
        passage = passages == number
        _, ends = ndimage.label(ndimage.binary_dilation(passage, EIGHT) & opened, EIGHT)
        if ends >= 2:
            doors.append(_middle(passage))
    return doors


def _junctions(free: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    """(2,) cells at which three or more ways of the skeleton meet."""
    thin = skeleton(free)
    for _ in range(round(SPUR / CELL)):
        thin &= ~((_neighbours(thin).sum(axis=0) == 1) & thin)
    meeting, count = ndimage.label(thin & (_crossings(_neighbours(thin)) >= 3), EIGHT)
    return [_middle(meeting == number) for number in range(1, count + 1)]


def _middle(mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(2,) the cell of a mask that is nearest to its centroid."""
    cells = np.argwhere(mask)
    nearest: NDArray[np.int64] = cells[np.linalg.norm(cells - cells.mean(axis=0), axis=1).argmin()]
    return nearest


def _neighbours(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(8, nx, ny) the neighbours of each cell of a mask, in the order of ``RING``."""
    padded = np.pad(mask, 1)
    nx, ny = mask.shape
    return np.stack([padded[1 + i : 1 + i + nx, 1 + j : 1 + j + ny] for i, j in RING])


def _crossings(around: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(nx, ny) how often the neighbours (8, nx, ny) change from outside to inside on the way around each cell."""
    return np.asarray((~around & np.roll(around, -1, axis=0)).sum(axis=0), np.int64)


def skeleton(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(nx, ny) the lines, a cell wide, to which a mask is thinned from its edges (Zhang and Suen 1984)."""
    thin, changes = mask.copy(), True
    while changes:
        changes = False
        for sides in (((0, 2, 4), (2, 4, 6)), ((0, 2, 6), (0, 4, 6))):
            around = _neighbours(thin)
            count = around.sum(axis=0)
            goes = thin & (count >= 2) & (count <= 6) & (_crossings(around) == 1)
            for side in sides:
                goes &= ~reduce(np.logical_and, around[list(side)])
            thin &= ~goes
            changes |= bool(goes.any())
    return thin
