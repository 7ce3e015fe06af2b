"""Whether what the camera sees agrees with the map: how a robot notices that it was carried elsewhere."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.frame import Frame
from pipeline.localisation.belief import CORRELATED_TILES, TILES, MotionState, tiles_seen
from pipeline.localisation.localisation import STILL_TURN, STILL_WAY
from pipeline.localisation.registration import FINE
from pipeline.localisation.relocalisation_kernels import cast
from pipeline.metric_map.metric_map import MetricMap
from pipeline.transforms import angle_of, inverse

DEPTH_TOLERANCE = 0.2
"""m by which a depth may differ from the map's: the diagonal of a voxel, 0.17, and noise."""


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
    def log_likelihoods(self) -> NDArray[np.float64]:
        """(5,) of each :class:`pipeline.localisation.belief.MotionState`."""
        return tiles_seen(self.explained, self.short + self.through, max(0, self.expected - self.known))

    @property
    def shows_another_place(self) -> bool:
        """Whether the frame is likelier if the robot was carried."""
        told = self.log_likelihoods
        return bool(told[MotionState.CARRIED] > told[MotionState.NOMINAL])

    @property
    def tells(self) -> bool:
        """Whether the map expects enough to be seen to tell a camera that sees nothing."""
        return self.expected >= CORRELATED_TILES


def agreement(frame: Frame, T_map_camera: NDArray[np.float64], metric_map: MetricMap) -> Agreement:
    """Compare a frame with what the map has before the camera, tile by tile of the depth image.

    A tile contradicts the map if all returns in the window around it are nearer, or farther, than all that the map
    has there, for every possible error of the pose. So neither pose errors at edges nor returns from dust count.
    """
    depth = tile_depths(frame)
    free, surface = expected_depths(frame, T_map_camera, metric_map)
    # A nearer voxel covers more than a window, though it may hold only the end of a wall beside the view.
    sensor = frame.sensor
    nearest, farthest = sensor.nearest + sensor.margin, sensor.farthest - sensor.margin
    surface = np.where(surface < nearest, np.inf, surface)
    short = _highest(depth) + DEPTH_TOLERANCE < _lowest(free)
    through = _lowest(depth) > _highest(surface) + DEPTH_TOLERANCE
    seen = np.isfinite(depth)
    # The windows of the outermost tiles would reach beyond the image.
    seen[[0, -1]] = seen[:, [0, -1]] = False
    explained = np.isfinite(surface) & ~short & ~through
    expected = int(((surface > nearest) & (surface < farthest))[1:-1, 1:-1].sum())
    counts = {"explained": explained, "short": short, "through": through, "seen": seen}
    return Agreement(**{name: int((mask & seen).sum()) for name, mask in counts.items()}, expected=expected)


def change(frame: Frame, last: Frame) -> Agreement | None:
    """Compare a frame with the last one, tile by tile, if the wheels stood: who was carried sees another place.

    None if the robot has moved. A frame from elsewhere may say nothing about the map, as before a wall too near for
    the camera; here it shows nothing where the last frame did.
    """
    moved = inverse(last.T_odom_base) @ frame.T_odom_base
    if np.linalg.norm(moved[:3, 3]) > STILL_WAY or angle_of(moved) > STILL_TURN:
        return None
    before, now = tile_depths(last), tile_depths(frame)
    seen, expected = np.isfinite(now), np.isfinite(before)
    both, shift = seen & expected, np.where(seen & expected, now, 0.0) - np.where(seen & expected, before, 0.0)
    short, through = int((shift < -DEPTH_TOLERANCE).sum()), int((shift > DEPTH_TOLERANCE).sum())
    return Agreement(int(both.sum()) - short - through, short, through, int(seen.sum()), int(expected.sum()))


def _lowest(depths: NDArray[np.float64]) -> NDArray[np.float64]:
    # In a window of ±2.7°, for a heading may be off by 2°.
    return ndimage.minimum_filter(depths, 3)


def _highest(depths: NDArray[np.float64]) -> NDArray[np.float64]:
    return ndimage.maximum_filter(depths, 3)


def _side(frame: Frame) -> int:
    """Pixels along the sides of a tile."""
    return max(2, frame.intrinsics.width // TILES)


def tile_depths(frame: Frame) -> NDArray[np.float64]:
    """(R, C) median depths of the tiles, m; infinite where fewer than half of a tile's pixels have a return."""
    side = _side(frame)
    rows, columns = (n // side for n in frame.depth.shape)
    depth = np.where(frame.returns, frame.depth, np.inf)[: rows * side, : columns * side]
    # Every second pixel of every second row is enough for a median.
    tiles = depth.reshape(rows, side, columns, side)[:, ::2, :, ::2].swapaxes(1, 2).reshape(rows, columns, -1)
    middle = tiles.shape[-1] // 2
    return np.partition(tiles, middle, axis=-1)[..., middle].astype(np.float64)


def expected_depths(
    frame: Frame, T_map_camera: NDArray[np.float64], metric_map: MetricMap
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Depths in the map before a camera off by up to ``FINE``, at the middle of every tile (R, C).

    Returns:
        m along the optical axis: the least depth up to which space is free, and the greatest at which the ray meets a
        surface; infinite if it meets none from one of the positions.
    """
    side = _side(frame)
    rows, columns = (n // side * side for n in frame.depth.shape)
    middle = frame.intrinsics.rays[side // 2 : rows : side, side // 2 : columns : side].astype(np.float64)
    shape, size = middle.shape[:2], metric_map.voxel_size
    rays = middle.reshape(-1, 3) @ T_map_camera[:3, :3].T
    shifts = FINE * np.array([(0, 0, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)])
    origins = T_map_camera[:3, 3] + shifts
    index = metric_map.voxel_index(np.vstack([origins, *(o + rays * metric_map.max_range for o in origins)]))
    lower, upper = index.min(axis=0), index.max(axis=0) + 1
    free, surface = np.empty(len(rays)), np.empty(len(rays))
    origins = (origins - metric_map.corner) / size - lower
    cast(rays, origins, metric_map.log_odds(lower, upper), metric_map.max_range / size, free, surface)
    return free.reshape(shape) * size, surface.reshape(shape) * size
