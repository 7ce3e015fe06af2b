"""Small worlds of known shape for the tests, as points that a perfect camera would have seen."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pipeline.elevation_map.elevation_kernels import lowest_rays
from pipeline.elevation_map.elevation_map import ElevationMap
from tests.pipeline.robot_model import PIONEER

Height = Callable[[NDArray, NDArray], NDArray]

RISE, RUN = 0.17, 0.59
"""m of half a NIST ramp."""


def ground_points(height: Height, x: tuple[float, float], y: tuple[float, float]) -> NDArray[np.float32]:
    """(N, 3) points of a height field, 1 cm apart."""
    xs, ys = np.meshgrid(np.arange(*x, 0.01) + 0.005, np.arange(*y, 0.01) + 0.005, indexing="ij")
    return np.column_stack([xs.ravel(), ys.ravel(), height(xs, ys).ravel()]).astype(np.float32)


def wall_points(a: tuple[float, float], b: tuple[float, float], height: float = 1.2) -> NDArray[np.float32]:
    """(N, 3) points of an upright panel from a to b, 1 cm apart."""
    length = np.hypot(b[0] - a[0], b[1] - a[1])
    t, z = np.meshgrid(np.arange(0, length, 0.01) / length, np.arange(0.005, height, 0.01), indexing="ij")
    xy = np.array(a) + t.ravel()[:, None] * (np.array(b) - np.array(a))
    return np.column_stack([xy, z.ravel()]).astype(np.float32)


def surface_of(*clouds: NDArray[np.float32], camera: tuple[float, float, float] | None = None) -> ElevationMap:
    """The elevation map of some clouds, seen by a camera or from nowhere."""
    elevation_map = ElevationMap(PIONEER)
    if camera is None:
        elevation_map.update(np.vstack(clouds))
    else:
        show(elevation_map, np.vstack(clouds), camera=np.array(camera))
    return elevation_map


def flat(x: NDArray, y: NDArray) -> NDArray:
    """Level ground at height 0."""
    return np.zeros_like(x)


def ridge(x: NDArray, y: NDArray) -> NDArray:
    """A ridge of two half ramps across the x axis, its crest at x = 0."""
    return RISE * np.clip(1 - np.abs(x) / RUN, 0, 1)


def ramp_and_deck(x: NDArray, y: NDArray) -> NDArray:
    """A half ramp from x = 0 up to a deck that begins at x = ``RUN``; both 1.2 m wide about y = 0, floor beside."""
    on = np.abs(y) <= 0.6
    return np.where(on, RISE * np.clip(x / RUN, 0, 1), 0.0)


def show(
    elevation_map: ElevationMap, points: np.ndarray, dropouts: np.ndarray | None = None, *, camera: np.ndarray
) -> None:
    """Add what a keyframe shows from a camera (3,): returns, and dropouts, (N, 3) and (M, 3) in ``map``, m."""
    camera = np.append(camera, 0.6)[:3]
    rays = lowest_rays(points, np.ones(len(points), np.uint32), camera, 0.05, 0.3, 3)
    missing = np.zeros((0, 3), np.float32) if dropouts is None else dropouts
    elevation_map.update(points, dropouts=missing, rays=rays, camera=camera)
