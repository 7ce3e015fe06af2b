"""Whether what the camera sees agrees with the map: how a robot notices that it was carried elsewhere."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.frame import Frame
from pipeline.localisation.relocalisation_kernels import cast
from pipeline.metric_map.metric_map import MetricMap

TILE = 20
"""Pixels along each side of the squares that are compared: 1.8° of the Xtion's 640 × 480."""
WINDOW = 3
"""Tiles along each side within which any depth will do: ±4.5°, for a pose may be wrong by 2°, and by 5 cm, which are
2.9° at 1 m."""
MARGIN = 0.2
"""m of depth that will do besides: the diagonal of a voxel, 0.17, and noise."""

CARRIED = 0.95
"""A robot that agrees less was carried."""


class Agreement(NamedTuple):
    """How many tiles of an image the map explains and contradicts; those of which it knows nothing count in neither.

    Attributes:
        explained: show what the map has there.
        short: show something in space that the map has as free.
        through: see through what the map has as occupied.
        seen: with returns.
    """

    explained: int
    short: int
    through: int
    seen: int

    @property
    def known(self) -> int:
        """Tiles of which the map knows what they show."""
        return self.explained + self.short + self.through

    @property
    def is_elsewhere(self) -> bool:
        """Whether the robot must have been carried."""
        return self.share < CARRIED

    @classmethod
    def of(cls, parts: Iterable["Agreement"]) -> "Agreement":
        """The sum of several frames' agreement."""
        return cls(*(sum(counts) for counts in zip(*parts, strict=True)))

    @property
    def share(self) -> float:
        """Of the known tiles those that the map explains, in [0, 1]; 1 if none is known."""
        return self.explained / self.known if self.known else 1.0


def agreement(frame: Frame, T_map_camera: NDArray[np.float64], metric_map: MetricMap) -> Agreement:
    """Compare a frame with the map as seen from a pose, tile by tile of the depth image.

    A tile contradicts the map if all returns in the window around it are nearer, or farther, than all of what the map
    has there. So neither errors of the pose at edges nor specks of dust count.
    """
    depth = tile_depths(frame)
    nearest, farthest = window(np.minimum, depth), window(np.maximum, depth)
    views = [expected(frame, shifted(T_map_camera, x, y), metric_map) for x, y in SHIFTS]
    free = np.min([f for f, _ in views], axis=0)
    solid = np.max([np.where(o, f, np.inf) for f, o in views], axis=0)
    is_occupied = np.isfinite(solid)
    short = farthest + MARGIN < window(np.minimum, free)
    through = np.isfinite(nearest) & (nearest > window(np.maximum, solid) + MARGIN)
    seen = np.isfinite(depth) & inner(depth.shape)
    explained = seen & is_occupied & ~short & ~through
    return Agreement(*(int(mask.sum()) for mask in (explained, short & seen, through & seen, seen)))


SHIFTS = ((0.0, 0.0), (0.1, 0.0), (-0.1, 0.0), (0.0, 0.1), (0.0, -0.1))


def shifted(T, x, y):
    result = T.copy()
    result[:2, 3] += x, y
    return result


def window(function, values):
    f = ndimage.minimum_filter if function is np.minimum else ndimage.maximum_filter
    return f(values, WINDOW, mode="nearest")


def inner(shape):
    result = np.zeros(shape, np.bool_)
    edge = WINDOW // 2
    result[edge:-edge, edge:-edge] = True
    return result


def tile_depths(frame: Frame) -> NDArray[np.float64]:
    """(H / TILE, W / TILE) median depths, m; infinite where fewer than half of the pixels returned."""
    rows, columns = (n // TILE for n in frame.depth.shape)
    depth = np.where(frame.returns, frame.depth, np.inf)[: rows * TILE : 2, : columns * TILE : 2]
    tiles = depth.reshape(rows, TILE // 2, columns, TILE // 2).swapaxes(1, 2).reshape(rows, columns, -1)
    middle = tiles.shape[-1] // 2
    return np.partition(tiles, middle, axis=-1)[..., middle].astype(np.float64)


def expected(
    frame: Frame, T_map_camera: NDArray[np.float64], metric_map: MetricMap
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """What the map has before a camera, at the middle of every tile (H / TILE, W / TILE).

    Returns:
        m along the optical axis up to which space is known to be free, and whether something occupied ends it there.
    """
    rays = frame.intrinsics.rays[TILE // 2 :: TILE, TILE // 2 :: TILE]
    shape, size = rays.shape[:2], metric_map.voxel_size
    rays = rays.reshape(-1, 3) @ T_map_camera[:3, :3].T
    ends = T_map_camera[:3, 3] + np.vstack([np.zeros((1, 3)), rays * metric_map.max_range])
    index = metric_map.voxel_index(ends)
    lower, upper = index.min(axis=0), index.max(axis=0) + 1
    origin = (T_map_camera[:3, 3] - metric_map.corner) / size - lower
    depth, is_occupied = np.empty(len(rays)), np.empty(len(rays), np.bool_)
    voxels = metric_map.log_odds(lower, upper)
    cast(rays.astype(np.float64), origin, voxels, 0.25, metric_map.max_range / size, depth, is_occupied)
    return depth.reshape(shape) * size, is_occupied.reshape(shape)
