"""Whether what the camera sees agrees with the map: how a robot notices that it was carried elsewhere."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.frame import Frame
from pipeline.localisation.relocalisation_kernels import cast
from pipeline.metric_map.metric_map import MetricMap
from pipeline.transforms import angle_of, inverse

TILE = 20
"""Pixels along each side of the squares that are compared: 1.8° of the Xtion's 640 × 480."""
WINDOW = 3
"""Tiles along each side of the window whose depths are all compared: ±2.7°, for a heading may be off by 2°."""
SHIFT = 0.1
"""m by which the pose may be off along x and y: 5 cm, and half a voxel."""
MARGIN = 0.2
"""m, tolerance of depth besides: the diagonal of a voxel, 0.17, and noise."""
CARRIED = 0.85
"""Least share of known tiles that the map must explain: at a right pose it explains 0.99, in dust of 0.5, 0.97."""
CONTRADICTED = 40
"""Least number of tiles that contradict the map: a twentieth of the image. Fewer may be one edge, or a thin panel."""

TELLING, SHOWN = 66, 1 / 3
"""Least number of expected tiles that count, a tenth of an image, and the least share of them that must be known: an
arena's frames show nearly all, while before a wall, or where nothing is mapped, a carried robot shows none."""
STILL, CHANGED = (0.02, np.deg2rad(2)), 1 / 3
"""m and rad by the odometry, and a share of tiles: a robot that moved less while more tiles changed was carried."""


class Agreement(NamedTuple):
    """Numbers of image tiles that the map explains and contradicts; tiles of which it knows nothing are neither.

    Attributes:
        explained: tiles that show what the map has there.
        short: tiles that show something in space that the map has as free.
        through: tiles that see through what the map has as occupied.
        seen: tiles with returns.
        expected: tiles in which the map has a surface within the camera's reach, with or without returns.
    """

    explained: int
    short: int
    through: int
    seen: int
    expected: int

    @classmethod
    def of(cls, parts: Iterable["Agreement"]) -> "Agreement":
        """The sum over several images."""
        return cls(*(sum(counts) for counts in zip(*parts, strict=True)))

    @property
    def known(self) -> int:
        """Number of tiles that the map explains or contradicts."""
        return self.explained + self.short + self.through

    @property
    def share(self) -> float:
        """Share of the known tiles that the map explains, in [0, 1]; 1 if none is known."""
        return self.explained / self.known if self.known else 1.0

    @property
    def was_carried(self) -> bool:
        """Whether the frames contradict the map so much that the robot must be elsewhere."""
        return self.share < CARRIED and self.short + self.through >= CONTRADICTED

    @property
    def is_doubtful(self) -> bool:
        """Whether so few of the expected tiles are known that the robot may well be elsewhere."""
        return self.expected >= TELLING and self.known < SHOWN * self.expected


def agreement(frame: Frame, T_map_camera: NDArray[np.float64], metric_map: MetricMap) -> Agreement:
    """Compare a frame with what the map has before the camera, tile by tile of the depth image.

    A tile contradicts the map if all returns in the window around it are nearer, or farther, than all that the map
    has there, for every possible error of the pose. So neither pose errors at edges nor specks of dust count.
    """
    depth = tile_depths(frame)
    free, surface = expected_depths(frame, T_map_camera, metric_map)
    # A nearer voxel covers more than a window, though it may hold only the end of a wall beside the view.
    nearest, farthest = frame.sensor.nearest + SHIFT, frame.sensor.farthest - MARGIN
    surface = np.where(surface < nearest, np.inf, surface)
    short = _highest(depth) + MARGIN < _lowest(free)
    through = _lowest(depth) > _highest(surface) + MARGIN
    seen = np.isfinite(depth)
    # The windows of the outermost tiles would reach beyond the image.
    seen[[0, -1]] = seen[:, [0, -1]] = False
    explained = np.isfinite(surface) & ~short & ~through
    expected = int(((surface > nearest) & (surface < farthest))[1:-1, 1:-1].sum())
    counts = {"explained": explained, "short": short, "through": through, "seen": seen}
    return Agreement(**{name: int((mask & seen).sum()) for name, mask in counts.items()}, expected=expected)


def shows_another_place(frame: Frame, last: Frame) -> bool:
    """Whether the image changed since the last frame although the wheels stood: the robot was carried.

    A frame from elsewhere may say nothing about the map, as before a wall too near for the camera.
    """
    moved = inverse(last.T_odom_base) @ frame.T_odom_base
    if np.linalg.norm(moved[:3, 3]) > STILL[0] or angle_of(moved) > STILL[1]:
        return False
    before, now = (np.where(np.isfinite(depths), depths, 0.0) for depths in map(tile_depths, (last, frame)))
    return bool((np.abs(now - before) > MARGIN).mean() > CHANGED)


def _lowest(depths: NDArray[np.float64]) -> NDArray[np.float64]:
    return ndimage.minimum_filter(depths, WINDOW)


def _highest(depths: NDArray[np.float64]) -> NDArray[np.float64]:
    return ndimage.maximum_filter(depths, WINDOW)


def tile_depths(frame: Frame) -> NDArray[np.float64]:
    """(H / TILE, W / TILE) median depths, m; infinite where fewer than half of the pixels have a return."""
    rows, columns = (n // TILE for n in frame.depth.shape)
    depth = np.where(frame.returns, frame.depth, np.inf)[: rows * TILE : 2, : columns * TILE : 2]
    tiles = depth.reshape(rows, TILE // 2, columns, TILE // 2).swapaxes(1, 2).reshape(rows, columns, -1)
    middle = tiles.shape[-1] // 2
    return np.partition(tiles, middle, axis=-1)[..., middle].astype(np.float64)


def expected_depths(
    frame: Frame, T_map_camera: NDArray[np.float64], metric_map: MetricMap
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Depths in the map before a camera that is off by up to SHIFT, at the middle of every tile (H / TILE, W / TILE).

    Returns:
        m along the optical axis: the least depth up to which space is free, and the greatest at which the ray meets a
        surface; infinite if it meets none from one of the positions.
    """
    rows, columns = (n // TILE * TILE for n in frame.depth.shape)
    middle = frame.intrinsics.rays[TILE // 2 : rows : TILE, TILE // 2 : columns : TILE].astype(np.float64)
    shape, size = middle.shape[:2], metric_map.voxel_size
    rays = middle.reshape(-1, 3) @ T_map_camera[:3, :3].T
    shifts = SHIFT * np.array([(0, 0, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)])
    origins = T_map_camera[:3, 3] + shifts
    index = metric_map.voxel_index(np.vstack([origins, *(o + rays * metric_map.max_range for o in origins)]))
    lower, upper = index.min(axis=0), index.max(axis=0) + 1
    free, surface = np.empty(len(rays)), np.empty(len(rays))
    origins = (origins - metric_map.corner) / size - lower
    cast(rays, origins, metric_map.log_odds(lower, upper), metric_map.max_range / size, free, surface)
    return free.reshape(shape) * size, surface.reshape(shape) * size
