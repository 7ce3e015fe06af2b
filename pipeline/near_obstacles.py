"""Obstacles too near for the camera to see, told by what a look does not show.

A wall nearer than the camera's range sends nothing back and hides the ground behind it. Where a look shows no ground
at all although it looks down, there is little to expect behind; that nothing came back never makes ground free.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Intrinsics
from pipeline.transforms import transform_points


@dataclass(frozen=True)
class NearObstaclesConfig:
    """When a column of the picture counts as blind, and what is then suspected.

    Attributes:
        depression: angle below the horizon from which on a ray meets level ground within the camera's range, rad.
        min_rows: share of a column's pixels that must look down so far; fewer tell nothing: the robot looks up a
            ramp, or over its crest.
        max_share: of them with a return in a blind column.
        distance: along the optical axis at which the obstacle is suspected, m: between the bumper and what the
            camera begins to see.
        beyond: m that it is believed to go on beyond the edge of the picture.
        spacing: of the points on it, m.
    """

    depression: float = np.deg2rad(20)
    min_rows: float = 0.12
    max_share: float = 0.02
    distance: float = 0.5
    beyond: float = 0.6
    spacing: float = 0.025


def near_obstacles(
    depth: NDArray[np.float32],
    intrinsics: Intrinsics,
    T_map_camera: NDArray[np.float64],
    config: NearObstaclesConfig | None = None,
) -> NDArray[np.float64]:
    """(N, 2) m in ``map``, points seen from above of obstacles that are suspected just before the camera.

    Args:
        depth: (H, W) float32 m along the optical axis; 0 = no return.
        intrinsics: of the depth image.
        T_map_camera: pose of ``camera_optical``.
        config: what counts.
    """
    config = config or NearObstaclesConfig()
    blind = _blind_columns(depth, intrinsics, T_map_camera[:3, :3], config)
    column = (np.arange(intrinsics.width) + 0.5 - intrinsics.cx) / intrinsics.fx * config.distance
    across = np.arange(column[0] - config.beyond, column[-1] + config.beyond, config.spacing)
    # Beyond its edges the picture is believed to go on as it ends.
    suspected = across[blind[np.searchsorted(column, across).clip(max=len(column) - 1)]]
    points = np.stack(
        [suspected, np.zeros_like(suspected), np.full_like(suspected, config.distance)], axis=-1
    )
    return transform_points(T_map_camera, points)[:, :2].astype(np.float64)


def _blind_columns(
    depth: NDArray[np.float32],
    intrinsics: Intrinsics,
    R_map_camera: NDArray[np.float64],
    config: NearObstaclesConfig,
) -> NDArray[np.bool_]:
    """(W,) the columns that should show ground, if there is any, and show nothing."""
    rays = intrinsics.rays
    down = -(rays @ R_map_camera[2].astype(np.float32)) / np.linalg.norm(rays, axis=-1)
    looks_down = down >= np.sin(config.depression)
    rows, returns = looks_down.sum(axis=0), (looks_down & (depth > 0)).sum(axis=0)
    return np.asarray((rows >= config.min_rows * len(depth)) & (returns <= config.max_share * rows))
