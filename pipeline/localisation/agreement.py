"""Agreement between frames and the map, which reveals whether the robot was carried elsewhere."""

from collections.abc import Iterable
from math import radians
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.arrays import Pose, Values
from pipeline.frame import Frame
from pipeline.geometry.ray_kernels import cast_rays
from pipeline.localisation.belief import CORRELATED_TILES, TILES, MotionState, tile_log_likelihoods
from pipeline.localisation.config import BeliefConfig
from pipeline.metric_map.metric_map import MetricMap
from pipeline.transforms import angle_of, inverse

DEPTH_TOLERANCE = 0.2
"""Maximum difference between a measured and a mapped depth, m: the diagonal of a voxel, 0.17 m, plus noise."""
POSE_ERROR = 0.1
"""Assumed maximum error of the camera's position when a frame is compared with the map, m."""
RAY_STEP = 0.25
"""Spacing of the samples of a ray, voxels along the optical axis."""
MAX_STILL_TRANSLATION, MAX_STILL_ROTATION = 0.02, radians(2)
"""Maximum translation, m, and rotation, rad, measured by the odometry between two frames for the wheels to count as
still."""


class Agreement(NamedTuple):
    """Numbers of image tiles that the map explains or contradicts; tiles in unmapped space are in neither group.

    Attributes:
        explained: tiles that show a surface of the map.
        short: tiles with returns where the map has free space.
        through: tiles with returns behind the surfaces of the map.
        seen: tiles with returns.
        expected: tiles in which the map has a surface within the camera's range, with or without returns.
    """

    explained: int
    short: int
    through: int
    seen: int
    expected: int

    @classmethod
    def of(cls, parts: Iterable["Agreement"]) -> "Agreement":
        """The numbers of tiles, summed over several images."""
        return cls(*(sum(counts) for counts in zip(*parts, strict=True)))

    @property
    def known(self) -> int:
        """Number of tiles that the map explains or contradicts."""
        return self.explained + self.short + self.through

    @property
    def explained_fraction(self) -> float:
        """Fraction of the known tiles that the map explains, in [0, 1]; 1 if there are none."""
        return self.explained / self.known if self.known else 1.0

    def log_likelihoods(self, config: BeliefConfig) -> Values:
        """(5,) log-likelihoods of the tiles under each :class:`pipeline.localisation.belief.MotionState`."""
        missing = max(0, self.expected - self.known)
        return tile_log_likelihoods(self.explained, self.short + self.through, missing, config)

    def shows_another_place(self, config: BeliefConfig) -> bool:
        """Whether the tiles are more likely if the robot was carried than if its motion was nominal."""
        likely = self.log_likelihoods(config)
        return bool(likely[MotionState.CARRIED] > likely[MotionState.NOMINAL])

    @property
    def expects_enough(self) -> bool:
        """Whether the map predicts enough returns for their absence to show that the camera has failed."""
        return self.expected >= CORRELATED_TILES


def agreement(frame: Frame, T_map_camera: Pose, metric_map: MetricMap) -> Agreement:
    """Compare a frame's depth image with the map, tile by tile.

    A tile contradicts the map only if all returns in the window around it are nearer than everything that the map
    predicts there, or all are farther, for every pose error up to ``POSE_ERROR``. Therefore, neither pose errors at
    edges nor returns from dust are taken for contradictions.
    """
    depth = tile_depths(frame)
    free, surface = expected_depths(frame, T_map_camera, metric_map)
    # Ignore voxels that are too near to measure, because each fills more than a window although it may contain only
    # the end of a wall.
    sensor = frame.sensor
    nearest, farthest = sensor.nearest + sensor.margin, sensor.farthest - sensor.margin
    surface = np.where(surface < nearest, np.inf, surface)
    short = _highest(depth) + DEPTH_TOLERANCE < _lowest(free)
    through = _lowest(depth) > _highest(surface) + DEPTH_TOLERANCE
    seen = np.isfinite(depth)
    # The windows of the outermost tiles extend beyond the image.
    seen[[0, -1]] = seen[:, [0, -1]] = False
    explained = np.isfinite(surface) & ~short & ~through
    expected = int(((surface > nearest) & (surface < farthest))[1:-1, 1:-1].sum())
    counts = {"explained": explained, "short": short, "through": through, "seen": seen}
    return Agreement(**{name: int((mask & seen).sum()) for name, mask in counts.items()}, expected=expected)


def agreement_with_previous(frame: Frame, last: Frame) -> Agreement | None:
    """Compare a frame with the previous one, tile by tile; None if the wheels moved.

    If the wheels are still, the view changes only if the robot is carried. In front of a wall that is too near for
    the camera, a frame cannot contradict the map, but it lacks returns that the previous frame had.
    """
    moved = inverse(last.T_odom_base) @ frame.T_odom_base
    if np.linalg.norm(moved[:3, 3]) > MAX_STILL_TRANSLATION or angle_of(moved) > MAX_STILL_ROTATION:
        return None
    before, now = tile_depths(last), tile_depths(frame)
    seen, expected = np.isfinite(now), np.isfinite(before)
    both, shift = seen & expected, np.where(seen & expected, now, 0.0) - np.where(seen & expected, before, 0.0)
    short, through = int((shift < -DEPTH_TOLERANCE).sum()), int((shift > DEPTH_TOLERANCE).sum())
    return Agreement(int(both.sum()) - short - through, short, through, int(seen.sum()), int(expected.sum()))


def _lowest(depths: NDArray[np.float64]) -> NDArray[np.float64]:
    """(R, C) m, smallest of the tiles' depths (R, C) in the window around each tile.

    The window covers ±2.7°, because the heading may be off by 2°.
    """
    return ndimage.minimum_filter(depths, 3)


def _highest(depths: NDArray[np.float64]) -> NDArray[np.float64]:
    """(R, C) m, greatest depth in the same windows."""
    return ndimage.maximum_filter(depths, 3)


def _tile_side(frame: Frame) -> int:
    """Side length of a tile, pixels."""
    return max(2, frame.intrinsics.width // TILES)


def tile_depths(frame: Frame) -> NDArray[np.float64]:
    """(R, C) median depths of the tiles, m; infinite where fewer than half of a tile's pixels have a return."""
    side = _tile_side(frame)
    rows, columns = (n // side for n in frame.depth.shape)
    depth = np.where(frame.returns, frame.depth, np.inf)[: rows * side, : columns * side]
    # Every second pixel of every second row is enough for a median.
    tiles = depth.reshape(rows, side, columns, side)[:, ::2, :, ::2].swapaxes(1, 2).reshape(rows, columns, -1)
    middle = tiles.shape[-1] // 2
    return np.partition(tiles, middle, axis=-1)[..., middle].astype(np.float64)


def expected_depths(
    frame: Frame, T_map_camera: Pose, metric_map: MetricMap
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Depths that the map predicts at the centre of every tile, for camera positions off by up to ``POSE_ERROR``.

    Returns:
        (R, C) smallest depth up to which space is free, and (R, C) largest depth at which the ray meets a surface,
        m along the optical axis. The largest depth is infinite if the ray from any of the positions meets no surface.
    """
    side = _tile_side(frame)
    rows, columns = (n // side * side for n in frame.depth.shape)
    middle = frame.intrinsics.rays[side // 2 : rows : side, side // 2 : columns : side].astype(np.float64)
    shape, size = middle.shape[:2], metric_map.voxel_size
    rays = middle.reshape(-1, 3) @ T_map_camera[:3, :3].T
    shifts = POSE_ERROR * np.array([(0, 0, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)])
    origins = T_map_camera[:3, 3] + shifts
    index = metric_map.voxel_index(np.vstack([origins, *(o + rays * metric_map.max_range for o in origins)]))
    lower, upper = index.min(axis=0), index.max(axis=0) + 1
    free, surface = np.empty(len(rays)), np.empty(len(rays))
    origins = (origins - metric_map.corner) / size - lower
    log_odds = metric_map.log_odds(lower, upper)
    cast_rays(rays, origins, log_odds, metric_map.max_range / size, RAY_STEP, free, surface)
    return free.reshape(shape) * size, surface.reshape(shape) * size
