"""Reads what OctoMap's own programs would read."""

from pathlib import Path

import numpy as np
import pyoctomap
from numpy.typing import NDArray

from pipeline.metric_map.metric_map import MetricMap

SIZE = 0.1
"""m, voxel size of the maps in these tests."""
Tree = pyoctomap.OcTree | pyoctomap.ColorOcTree


def read_bt(path: Path) -> pyoctomap.OcTree:
    """A ``.bt`` file."""
    tree = pyoctomap.OcTree(0.3)
    assert tree.readBinary(str(path))
    return tree


def read_ot(path: Path) -> pyoctomap.ColorOcTree:
    """A coloured ``.ot`` file."""
    return pyoctomap.ColorOcTree(0.3).read(str(path))


def log_odds(tree: Tree, lower: NDArray[np.int64], shape: tuple[int, ...]) -> NDArray[np.float32]:
    """(nx, ny, nz) of a box of voxels; 0 = unknown."""
    result = np.zeros(shape, np.float32)
    for index in np.ndindex(*shape):
        node = tree.search(((lower + index + 0.5) * SIZE).tolist())
        if node:
            result[index] = node.getLogOdds()
    return result


def colours(tree: pyoctomap.ColorOcTree, metric_map: MetricMap) -> NDArray[np.int64]:
    """(N, 3) RGB of the map's occupied voxels."""
    places = (metric_map.voxel_index(metric_map.occupied_centres()) + 0.5) * SIZE
    return np.array([tree.search(place.tolist()).getColor() for place in places]).reshape(-1, 3)
