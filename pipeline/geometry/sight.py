"""Visibility of cells of a grid from other cells."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Cells, MaskLayer
from pipeline.geometry import sight_kernels as kernels


def visible_cells(cells: Cells, target: MaskLayer, walls: MaskLayer, reach: int) -> NDArray[np.bool_]:
    """(K, 2 reach + 1, 2 reach + 1) whether target cells are seen from each of K cells, in a window around it.

    Args:
        cells: (K, 2) grid indices of the cells from which to look.
        target: cells to be seen.
        walls: cells that hide the cells behind them.
        reach: maximum distance of sight, cells.
    """
    return kernels.visible_cells(cells, target, walls, ray_tree(reach), reach)


@cache
def ray_tree(reach: int) -> NDArray[np.int32]:
    """(N, 3) int32 the cells on rays from a cell's centre to all cells on the rim of a square, ``reach`` cells away.

    An entry consists of a cell's offset (i, j), and of the index of the next entry that does not lie behind this
    cell, from which to continue if the cell is a wall. Rays that begin with the same cells share the entries of these
    cells.
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
    return np.array(entries, np.int32)
