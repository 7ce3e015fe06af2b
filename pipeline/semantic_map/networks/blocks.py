"""Cut clouds into blocks for the networks: columns of points with six channels each, or nine with colours."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Indices, Place
from pipeline.geometry.thinning import VoxelCloud
from pipeline.labels import Label
from pipeline.semantic_map.classifier import CLASSES

CHANNELS, COLOURED = 6, 9
"""Number of channels of a point, without and with its colour; see :func:`channels`."""
NO_CLASS = -1
CLASS_OF_LABEL = np.full(len(Label), NO_CLASS, np.int8)
"""(8,) index in CLASSES of every label, or NO_CLASS."""
CLASS_OF_LABEL[list(CLASSES)] = range(len(CLASSES))
CLASS_OF_LABEL[Label.VICTIM] = CLASSES.index(Label.CLUTTER)  # because the victim detector finds victims


@dataclass(frozen=True)
class BlockConfig:
    """How clouds are cut into blocks; a network needs the settings that it was trained with."""

    voxel_size: float = 0.03
    """Edge length of a voxel, m; a cloud is thinned to one point per voxel, so that its density varies less."""
    size: float = 1.0
    """Edge length of a column in x and y, m."""
    points: int = 4096
    """Maximum number of points of a block."""
    reach: float = 3.5
    """Range of the camera, m; normalised coordinates are offsets from the camera, divided by this range."""


@dataclass(frozen=True, eq=False)
class Block:
    """A column of a cloud, or a random part of a column that has too many points.

    Attributes:
        index: indices of the block's points in the cloud; an index may occur several times.
        points: (n, 6 or 9) float32, see :func:`channels`.
    """

    index: Indices
    points: NDArray[np.float32]


def cut(
    points: NDArray[np.float32],
    camera: Place,
    config: BlockConfig,
    shift: float,
    min_points: int,
    rng: np.random.Generator,
) -> Iterator[Block]:
    """Yield blocks that together contain every point at least once.

    Args:
        points: (M, 3) finite float32 points in ``map``, or (M, 6) with their colours.
        camera: position of the camera.
        config: settings of the blocks.
        shift: offset of the grid of columns along x and y, m.
        min_points: minimum number of points of a block; smaller blocks are padded with random repeats of points.
        rng: generator that draws the repeats and randomly splits columns with too many points.
    """
    columns = np.floor((points[:, :2] - shift) / config.size).astype(np.int64)
    order = np.lexsort(columns.T)
    ends = np.flatnonzero((np.diff(columns[order], axis=0) != 0).any(axis=1)) + 1
    for index in np.split(order, ends) if len(points) else []:
        centre = (columns[index[0]] + 0.5) * config.size + shift
        parts = -(-len(index) // config.points)
        for part in np.array_split(rng.permutation(index), parts) if parts > 1 else [index]:
            if len(part) < min_points:
                part = np.append(part, rng.choice(part, min_points - len(part)))
            yield Block(part, channels(points[part], centre, camera, config))


def channels(points: NDArray[np.float32], centre: Place, camera: Place, config: BlockConfig) -> NDArray[np.float32]:
    """(n, 6) float32: x and y relative to the centre of the block, z in ``map``, then normalised x, y and z.

    With colours, the result is (n, 9), and the colours precede the normalised coordinates, as in the blocks of S3DIS.

    S3DIS normalises by the extent of a room. A frame has no such extent, so the offset from the camera is divided by
    the camera's range. Distances keep their proportions, and the network can learn how noise depends on the distance.
    """
    xyz, colours = np.split(points, [3], axis=1)
    here = xyz - np.append(centre, 0)
    return np.concatenate([here, colours, (xyz - camera) / config.reach], axis=1).astype(np.float32)


def coloured(cloud: VoxelCloud, colours: NDArray[np.uint8]) -> NDArray[np.float32]:
    """(M, 6) float32 points of a cloud, m, and their mean colours from 0 to 1, given (N, 3) RGB of all returns."""
    whole = np.iinfo(colours.dtype).max
    return np.concatenate([cloud.points, cloud.means(colours.astype(np.float32)) / whole], axis=1)
